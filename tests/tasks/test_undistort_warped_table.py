"""The camera's table warped onto a frame: planted warps, the choice between the two models of a frame, bad input."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from catalog.errors import RefusedError
from catalog.observation import Observation
from catalog.reseau import find_reseau_table
from tasks.undistort.bending import BendingField, bending_field
from tasks.undistort.bent_plate import BentModel, fit_bent_plate
from tasks.undistort.frame_map import bending_error_planes
from tasks.undistort.mark_set import MarkSet
from tasks.undistort.warped_table import fit_warped_table

RAW, OBJECT = (800, 800), (1000, 1000)
TABLE = find_reseau_table("vg1_na_sn7")


@pytest.fixture(scope="module")
def field() -> BendingField:
    y, x = np.mgrid[0:800, 0:800]
    image = 8 + 180 / (1 + np.exp((np.hypot(x - 470, y - 430) - 200) / 0.8))
    return bending_field(Observation(image.astype(np.float32), np.ones_like(image), np.zeros(RAW, np.uint16)), 255.0)


def warp(raw: np.ndarray) -> np.ndarray:
    u = (raw - 399.5) / 400
    return np.stack([0.6 + 0.8 * u[:, 0] - 0.5 * u[:, 1] ** 2, -1.1 + 0.4 * u[:, 1] + 0.6 * u[:, 0] ** 3], axis=1)


def frame_marks(noise_px: float) -> MarkSet:
    """Marks of the table, moved by a smooth warp and measured with noise."""
    raw = TABLE.raw_xy + warp(TABLE.raw_xy)
    seen = raw + np.random.default_rng(4).normal(0, noise_px, raw.shape)
    there = ((raw > 0) & (raw < 799)).all(axis=1)
    sigma = np.where(there, 0.1, 2.0)
    return MarkSet(seen, TABLE.object_xy, sigma, there, ~there, RAW, OBJECT, TABLE.raw_xy)


def test_the_irregularities_of_the_table_are_kept_and_noise_of_the_frame_averages_out(field: BendingField) -> None:
    """With marks measured to 0.1 px, exact marks of the same frame are predicted far better than they were measured."""
    dark = replace(field, towards=np.zeros_like(field.towards))
    marks = frame_marks(0.1)
    exact = TABLE.raw_xy + warp(TABLE.raw_xy)
    there = marks.found
    error = {
        name: np.linalg.norm(model.undistort_points(exact[there]) - TABLE.object_xy[there], axis=1)
        for name, model in (
            ("warped-table", fit_warped_table(marks, dark)),
            ("beam-bending", fit_bent_plate(marks, dark)),
        )
    }
    print({name: f"RMS {np.sqrt((e**2).mean()):.3f} px" for name, e in error.items()})
    assert np.sqrt((error["warped-table"] ** 2).mean()) < 0.08
    assert np.median(error["warped-table"]) < 0.5 * np.median(error["beam-bending"])


def test_leave_one_out_errors_say_which_model_is_better(field: BendingField) -> None:
    """Noise of the table in place of real irregularities, and the plate through the frame's own marks wins."""
    dark = replace(field, towards=np.zeros_like(field.towards))
    real = frame_marks(0.05)
    assert (
        fit_warped_table(real, dark).report.robust_leave_one_out_px
        < fit_bent_plate(real, dark).report.robust_leave_one_out_px
    )
    rough = TABLE.raw_xy + np.random.default_rng(1).normal(0, 1.0, TABLE.raw_xy.shape)
    smooth_object = 499.5 + 1.24 * (TABLE.raw_xy - 399.5)
    wrong_table = replace(real, object_xy=smooth_object, nominal_xy=rough)
    assert (
        fit_warped_table(wrong_table, dark).report.robust_leave_one_out_px
        > fit_bent_plate(wrong_table, dark).report.robust_leave_one_out_px
    )


def test_the_error_of_the_bending_moves_the_disk_and_not_the_far_sky(field: BendingField) -> None:
    model = fit_warped_table(frame_marks(0.05), field)
    planes = bending_error_planes(model)
    assert planes is not None
    assert planes.shape == (2, 1000, 1000)
    on_limb = np.hypot(*planes[:, 480:600, 330:345]).max()
    sky = np.hypot(*planes[:, 40:80, 40:80]).max()
    assert on_limb == pytest.approx(model.spread * np.linalg.norm(field(np.array([[270.0, 430.0]]))), rel=0.5)
    assert sky < 0.3 * on_limb
    assert bending_error_planes(model.smooth_part) is None


@pytest.mark.parametrize("fit", [fit_warped_table, fit_bent_plate])
def test_the_error_of_the_bending_is_what_another_strength_would_move(
    fit: Callable[..., BentModel], field: BendingField, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The smooth part is fitted to the marks again: what they show of the bending does not move."""
    from tasks.undistort import bent_plate, warped_table

    marks, spread = frame_marks(0.05), 0.002
    models = []
    for strength in (0.0, spread):
        for module in (bent_plate, warped_table):
            monkeypatch.setattr(module, "with_experience", lambda *_, k=strength: (k, spread))
        models.append(fit(marks, field))
    planes = bending_error_planes(models[0])
    assert planes is not None
    x, y = np.meshgrid(np.arange(150, 900, 30), np.arange(150, 900, 30))
    raw = models[0].distort_points(np.stack([x, y], axis=-1).astype(float))
    moved = models[1].undistort_points(raw) - models[0].undistort_points(raw)
    off = np.linalg.norm(moved - np.moveaxis(planes[:, y, x], 0, -1), axis=-1)
    print(f"{fit.__name__}: moved by up to {np.abs(moved).max():.3f} px, foreseen to {off.max():.4f}")
    assert off.max() < 0.1 * np.abs(moved).max()


def test_marks_without_a_table_are_refused(field: BendingField) -> None:
    with pytest.raises(RefusedError, match="the camera's table of the same marks"):
        fit_warped_table(replace(frame_marks(0.05), nominal_xy=None), field)
