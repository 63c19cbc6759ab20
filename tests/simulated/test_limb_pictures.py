"""Pictures of the limb: what is drawn is what was measured, before and after."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lab.simulate.small_world import observation_of, scene_of, small_camera, true_pose
from tasks.compare.limb_edges import LimbSettings
from tasks.pictures.limb_figures import shifts_figure, write_limb_figures
from tasks.pictures.limb_profiles import LimbComparison, compare_limbs
from tasks.pictures.product import Product
from tasks.point.rotation import pose_moved_by
from tasks.validate import validate_limb

CAMERA = small_camera(diameter_px=120.0, size_px=(180, 170)).model_copy(update={"centre_px": (84.3, 82.6)})
SCENE = scene_of(CAMERA)
TRUTH = true_pose(CAMERA)
MOVED_PX = (7.0, -4.0)


@pytest.fixture(scope="module")
def product() -> Product:
    predicted = pose_moved_by(TRUTH, CAMERA, MOVED_PX)
    return Product("small", observation_of(SCENE, TRUTH), predicted, TRUTH, SCENE, LimbSettings())


@pytest.fixture(scope="module")
def comparison(product: Product) -> LimbComparison:
    return compare_limbs(product)


def test_the_segments_after_are_those_of_the_validation(product: Product, comparison: LimbComparison) -> None:
    report = validate_limb(product.observation, TRUTH, SCENE)
    assert comparison.after.rms_px == pytest.approx(report.rms_px)
    assert len(comparison.after.shift_px) == report.points


def test_the_shifts_before_are_the_planted_move_seen_outward(comparison: LimbComparison) -> None:
    before = comparison.before
    assert before is not None
    assert comparison.apart_px == pytest.approx(np.hypot(*MOVED_PX), abs=1)
    outward = before.segments.normal @ np.negative(MOVED_PX)
    along = np.abs(np.where(before.segments.horizontal, before.segments.normal[:, 0], before.segments.normal[:, 1]))
    assert np.median(before.shift_px - outward / along) == pytest.approx(0, abs=0.6)  # the limb is round


def test_profiles_run_outward_from_the_limb(comparison: LimbComparison) -> None:
    after = comparison.after
    assert (np.diff(after.steps_px, axis=1) == 1).all()
    assert np.abs(after.steps_px[:, after.settings.half_px]).max() <= 0.5
    inside, outside = after.image[:, :4].mean(), after.image[:, -4:].mean()
    assert inside > outside + 30
    peak = after.steps_px[:, 1:-1][np.arange(len(after.image)), after.falls(after.image).argmax(axis=1)]
    assert np.abs(np.median(peak)) < 0.5


def test_four_pictures_are_written(comparison: LimbComparison, tmp_path: Path) -> None:
    paths = write_limb_figures(comparison, tmp_path, "limb")
    assert list(paths) == ["segments", "profiles", "derivatives", "shifts"]
    for name, path in paths.items():
        assert path == tmp_path / f"limb-{name}.png"
        assert path.read_bytes().startswith(b"\x89PNG")


def test_a_prediction_that_is_far_away_has_no_segments_and_the_picture_says_so(
    product: Product, comparison: LimbComparison
) -> None:
    lost = LimbComparison(product, None, comparison.after, 300.0)
    figure = shifts_figure(lost)
    assert figure.get_suptitle() == "small (predicted limb 300 px away: no segments there)"
    assert len(figure.axes) == 3
    far = pose_moved_by(product.before, CAMERA, (60.0, 0.0))
    assert compare_limbs(replace(product, before=far)).before is None
