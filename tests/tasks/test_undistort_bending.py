"""Beam bending: its law, its coefficient from the marks, and the model that contains it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from catalog.camera import known_cameras
from catalog.errors import RefusedError
from catalog.observation import Observation, Quality
from catalog.reseau import find_reseau_table
from tasks.undistort import UndistortSettings
from tasks.undistort.bending import USUAL_PX_PER_DN, BendingField, bending_field
from tasks.undistort.bent_plate import BentModel, coefficient_of_frame, fit_bent_plate
from tasks.undistort.choose import chosen_model
from tasks.undistort.frame_map import raw_places, uncertainty_plane
from tasks.undistort.mark_set import MarkSet
from tasks.undistort.thin_plate import fit_thin_plate
from tasks.undistort.turned import TurnedModel

RAW, OBJECT = (800, 800), (1000, 1000)
CENTRE, RADIUS, DISK_DN, SKY_DN = (470.0, 430.0), 240.0, 200.0, 8.0


def frame(image: np.ndarray) -> Observation:
    return Observation(image.astype(np.float32), np.ones(image.shape, np.float32), np.zeros(image.shape, np.uint16))


def disk() -> Observation:
    y, x = np.mgrid[0:800, 0:800]
    edge = RADIUS - np.hypot(x - CENTRE[0], y - CENTRE[1])
    return frame(SKY_DN + DISK_DN / (1.0 + np.exp(-edge / 0.8)))


def smooth_truth(raw: np.ndarray) -> np.ndarray:
    u = (raw - 399.5) / 400.0
    return 499.5 + 590.0 * u + 5.0 * u**3 - 3.0 * (u**2).sum(axis=-1, keepdims=True) * u


def bent_marks(field: BendingField, k: float, noise_px: float = 0.08, seed: int = 1) -> MarkSet:
    """Marks seen at raw places scattered by noise, whose true places follow the smooth distortion and the bending."""
    raw = find_reseau_table("vg1_na_sn7").raw_xy
    seen = raw + np.random.default_rng(seed).normal(0, noise_px, raw.shape)
    there = np.ones(len(raw), bool)
    return MarkSet(seen, smooth_truth(raw) + k * field(raw), 0.1 * there, there, ~there, RAW, OBJECT, raw)


@pytest.fixture(scope="module")
def field() -> BendingField:
    return bending_field(disk(), saturation_dn=255.0)


@pytest.fixture(scope="module")
def model(field: BendingField) -> BentModel:
    return fit_bent_plate(bent_marks(field, 0.04), field)


def test_the_pull_points_at_unread_brightness(field: BendingField) -> None:
    x, y = CENTRE
    top, bottom, left, right = field(
        np.array([[x, y - RADIUS - 3], [x, y + RADIUS + 3], [x - RADIUS - 3, y], [x + RADIUS + 3, y]])
    )
    assert top[1] > 20  # the whole disk is still to be read
    assert bottom[1] == pytest.approx(SKY_DN / np.pi, rel=0.05)  # only sky is left below
    assert left[0] > 10
    assert right[0] == pytest.approx(-left[0], rel=1e-3)
    inside, far = field(np.array([[x, y], [x, y - RADIUS - 90]]))
    assert inside[0] == pytest.approx(0.0, abs=1e-6)
    assert inside[1] > 20
    assert far[1] == pytest.approx(SKY_DN / np.pi, rel=0.05)


def test_an_even_frame_pulls_alike_everywhere_and_gaps_do_not_count() -> None:
    even = frame(np.full((200, 200), 50.0))
    pull = bending_field(even, 255.0).planes
    assert np.ptp(pull[1]) < 1e-3
    assert pull[1].mean() == pytest.approx(50.0 / np.pi, rel=0.05)  # the half plane's mean unit vector times its weight
    even.image[80:90] = 0
    even.quality[80:90] = Quality.MISSING
    assert np.ptp(bending_field(even, 255.0).planes[1]) < 1e-3


@pytest.mark.parametrize("k", [0.0, 0.02, 0.04])
def test_a_planted_coefficient_is_found_from_the_marks(field: BendingField, k: float) -> None:
    found, spread = coefficient_of_frame(bent_marks(field, k), field)
    print(f"planted {k}, found {found:.4f} +- {spread:.4f}")
    assert abs(found - k) < 4 * spread + 1e-4
    assert spread < 0.003


def test_the_limb_between_marks_is_placed_right_where_marks_alone_miss_it(field: BendingField) -> None:
    marks = bent_marks(field, 0.04)
    angle = np.radians(np.arange(0, 360, 5))
    limb = np.stack([CENTRE[0] + RADIUS * np.cos(angle), CENTRE[1] + RADIUS * np.sin(angle)], axis=1)
    true = smooth_truth(limb) + 0.04 * field(limb)
    error = {
        name: np.linalg.norm(fitted.undistort_points(limb) - true, axis=1)
        for name, fitted in (("thin-plate", fit_thin_plate(marks)), ("beam-bending", fit_bent_plate(marks, field)))
    }
    print({name: f"median {np.median(e):.2f}, largest {e.max():.2f} px" for name, e in error.items()})
    assert np.median(error["beam-bending"]) < 0.1
    assert np.median(error["thin-plate"]) > 3 * np.median(error["beam-bending"])


def test_leave_one_out_falls_when_the_bending_is_known(field: BendingField) -> None:
    marks = bent_marks(field, 0.04)
    assert fit_bent_plate(marks, field).report.leave_one_out_px < 0.6 * fit_thin_plate(marks).report.leave_one_out_px


@settings(deadline=None, max_examples=60)
@given(x=st.floats(-300, 1300), y=st.floats(-300, 1300))
def test_the_bent_model_round_trips(model: BentModel, x: float, y: float) -> None:
    assert np.abs(model.undistort_points(model.distort_points([x, y])) - [x, y]).max() < 1e-6


def test_the_map_of_the_frame_agrees_with_the_points(model: BentModel) -> None:
    at = np.random.default_rng(3).integers(0, 1000, (400, 2))
    for mapped in (model, TurnedModel(model, 0.3, (499.0, 499.0))):
        x, y, _ = raw_places(mapped)
        places = np.stack([x, y], axis=-1)[at[:, 1], at[:, 0]]
        exact = mapped.distort_points(at.astype(float))
        assert np.abs(places - exact).max() < 0.02
        assert np.median(np.abs(places - exact)) < 1e-3
        assert uncertainty_plane(mapped).shape == (1000, 1000)


def test_a_frame_that_tells_nothing_gets_the_usual_bending_and_calibrated_units_none() -> None:
    dark = frame(np.random.default_rng(0).normal(10, 0.5, (800, 800)))
    marks = bent_marks(bending_field(dark, 255.0), 0.0)
    raw_dn = fit_bent_plate(marks, bending_field(dark, 255.0))
    assert raw_dn.px_per_dn == pytest.approx(USUAL_PX_PER_DN, abs=0.012)
    calibrated = fit_bent_plate(marks, bending_field(dark, None))
    assert calibrated.px_per_dn == 0.0


def test_bending_needs_a_frame_with_marks() -> None:
    with pytest.raises(RefusedError, match="thin-plate"):
        chosen_model(known_cameras()["voyager1-nac"], UndistortSettings(method="beam-bending", marks="nominal"))
