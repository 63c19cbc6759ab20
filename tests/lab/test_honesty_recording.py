"""Faults on the way into the file: each spoils what it says, and nothing else."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from lab.honesty.geometry import planted_errors, predicted_geometry, true_geometry
from lab.honesty.picture import target_solid
from lab.honesty.recording import FAULTS, Recorded, spoiled
from lab.honesty.report import planted
from lab.honesty.scene import Scene
from lab.honesty.table_recording import STRENGTHS

PLACE, RADIUS, FULL = (50.0, 40.0), 25.0, 255.0


def disk() -> NDArray[np.float64]:
    """A disk of 200 DN, brighter below, before a sky of 5."""
    y, x = np.mgrid[:96, :104]
    inside = np.hypot(x - PLACE[0], y - PLACE[1]) < RADIUS
    return np.where(inside, np.round(140 + y), 5.0).astype(np.float64)


def with_fault(name: str, size: float) -> NDArray[np.int16]:
    return spoiled(Recorded(disk(), size, FULL, PLACE, RADIUS, np.random.default_rng(1)), name)


@pytest.mark.parametrize("name", list(FAULTS))
def test_every_fault_has_scenes_changes_the_picture_and_keeps_it_in_range(name: str) -> None:
    assert name in STRENGTHS
    for strength in STRENGTHS[name]:
        found = with_fault(name, strength)
        assert found.shape == disk().shape
        assert found.dtype == np.int16
        assert (found != disk()).any()
        assert found.min() >= 0
        assert found.max() <= FULL


def test_faults_are_as_strong_as_they_say() -> None:
    assert (with_fault("zero-filled", 0.0)[:40, :50] == 0).all()
    np.testing.assert_array_equal(with_fault("zero-filled", 0.0)[40:], disk()[40:])
    assert np.unique(with_fault("few-levels", 4)).size <= 16
    assert with_fault("clipped", 0.7).max() == pytest.approx(0.7 * np.percentile(disk(), 99.9), abs=1)
    np.testing.assert_array_equal(with_fault("lines-left-out", 3)[45:90], disk()[48:93])
    np.testing.assert_array_equal(with_fault("two-gains", 0.1)[:, :50], disk()[:, :50])
    assert with_fault("two-gains", 0.1)[40, 60] == pytest.approx(1.1 * disk()[40, 60], abs=1)
    width = [int((picture[40] > 90).sum()) for picture in (disk(), with_fault("stretched", 0.2))]
    assert width[1] == pytest.approx(1.2 * width[0], abs=2)
    assert with_fault("stretched", 0.2)[40, 50] == disk()[40, 50]


def test_the_same_lines_and_columns_are_spoiled_again() -> None:
    for name in ("bright-columns", "cosmic-rays", "line-jitter", "dropped-lines"):
        np.testing.assert_array_equal(with_fault(name, 0.2), with_fault(name, 0.2))


def test_a_wrong_time_turns_the_body_about_its_pole_and_a_wrong_shape_its_radii() -> None:
    scene = Scene("made-000", "made", 5, orientation_deg=0.0, late_deg=7.0, radii=(1.0, 1.0, 0.98))
    true = true_geometry(scene)
    turned = predicted_geometry(scene, true, planted_errors(scene)).body_from_j2000 @ true.body_from_j2000.T
    np.testing.assert_allclose(turned[2], [0, 0, 1], atol=1e-12)
    assert np.degrees(np.arccos(turned[0, 0])) == pytest.approx(7.0)
    usual = target_solid(replace(scene, radii=(1.0, 1.0, 1.0)), true)[0].radii_km
    np.testing.assert_allclose(target_solid(scene, true)[0].radii_km / usual, [1, 1, 0.98])
    for spoilt in ({"fault": "blocks"}, {"radii": (1.0, 1.0, 0.98)}, {"late_deg": 7.0}, {"map_contrast": -0.3}):
        assert not Scene("made-001", "made", 6, **spoilt).solvable
    row = {"scene": scene.to_dict() | {"fault": "blocks", "fault_size": 0.01}}
    row["truth"] = {"planted": planted_errors(scene)}
    assert {"blocks 0.01", "radii x (1.0, 1.0, 0.98)", "time late by 7.0 deg"} <= set(planted(row).split("; "))
