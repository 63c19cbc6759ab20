"""Finding reseau marks: planted ones are found where they are, and nothing else is."""

import dataclasses
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from catalog.observation import Observation, Quality
from catalog.reseau import ReseauTable, find_reseau_table, reseau_table_names
from tasks.undistort.mark_fill import filled
from tasks.undistort.mark_fit import fit_marks, spot
from tasks.undistort.mark_search import without_copied_edges
from tasks.undistort.reseau_marks import MarkState, find_marks

SIZE = 800


@dataclass(frozen=True)
class Planted:
    """observation: the frame. table: the nominal marks. xy (202, 2): where the marks really are."""

    observation: Observation
    table: ReseauTable
    xy: NDArray[np.float64]

    @property
    def inside(self) -> NDArray[np.bool_]:
        """Marks whose centre lies at least 1.5 px inside the frame."""
        return ((self.xy > 1.5) & (self.xy < SIZE - 2.5)).all(axis=1)


def planted_frame(name: str, seed: int, sky_dn: float = 8.0, disk_dn: float = 180.0, noise_dn: float = 0.7) -> Planted:
    """A textured disk on sky, quantised to whole numbers; the marks are shifted from nominal by a few pixels, smoothly,
    and bent by 1.5 px around the disk."""
    rng = np.random.default_rng(seed)
    table = find_reseau_table(name)
    xy = shifted(table.raw_xy, rng)
    image = disk_on_sky(rng, sky_dn, disk_dn)
    for x, y in xy:
        left, top = max(int(x) - 7, 0), max(int(y) - 7, 0)
        window = image[top : int(y) + 9, left : int(x) + 9]
        rows, columns = np.indices(window.shape, dtype=np.float64)
        window *= 1.0 - 0.95 * spot(columns + left - x, rows + top - y)[0]
    image = np.clip(np.rint(image + rng.normal(0.0, noise_dn, image.shape)), 0, 255).astype(np.float32)
    noise = np.full(image.shape, noise_dn, np.float32)
    return Planted(Observation(image, noise, np.zeros(image.shape, np.uint16)), table, xy)


def shifted(raw_xy: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
    """Marks as a frame shows them: shift, turn, scale, a cubic, and a bend around the frame's middle."""
    u = (raw_xy - 400.0) / 400.0
    shift = rng.uniform(-4, 4, 2) + u @ rng.normal(0, 1.0, (2, 2)) + u**3 @ rng.normal(0, 0.5, (2, 2))
    return raw_xy + shift + 1.5 * u * np.exp(-(((u**2).sum(axis=1, keepdims=True) - 0.3) ** 2) / 0.05)


def disk_on_sky(rng: np.random.Generator, sky_dn: float, disk_dn: float) -> NDArray[np.float64]:
    """Noise-free frame (800, 800): a disk of 230 px radius with 10 % texture."""
    import cv2

    y, x = np.mgrid[0:SIZE, 0:SIZE].astype(np.float64)
    texture = cv2.GaussianBlur(rng.normal(0, 1, (SIZE, SIZE)), (0, 0), 6.0)
    bright = disk_dn * (1.0 + 0.1 * texture / texture.std())
    edge = 1.0 / (1.0 + np.exp((np.hypot(x - 450, y - 420) - 230.0) / 0.8))
    return np.maximum(sky_dn + edge * bright, 0.0)


@pytest.mark.parametrize("name", reseau_table_names())
def test_planted_marks_of_every_camera_are_found_to_a_tenth_of_a_pixel(name: str) -> None:
    planted = planted_frame(name, seed=11)
    marks = find_marks(planted.observation, planted.table)
    error = np.linalg.norm(marks.xy - planted.xy, axis=1)
    found = marks.found
    print(
        f"{name}: {found.sum()} found of {planted.inside.sum()} well inside; "
        f"error median {np.median(error[found]):.3f}, largest {error[found].max():.2f} px"
    )
    assert (found & planted.inside).sum() >= planted.inside.sum() - 2
    assert np.median(error[found]) < 0.1
    assert error[found].max() < 1.0
    assert (marks.state[(planted.xy < -1.5).any(axis=1)] == MarkState.OUTSIDE).all()


def test_the_stated_uncertainty_covers_the_error() -> None:
    planted = planted_frame("vg2_na_sn5", seed=5)
    marks = find_marks(planted.observation, planted.table)
    pull = ((marks.xy - planted.xy) / marks.sigma_px[:, None])[marks.found]
    assert 0.3 < np.sqrt(np.mean(pull**2)) < 1.5
    assert np.mean(np.abs(pull) > 3) < 0.02


def test_columns_that_never_arrived_hide_their_marks() -> None:
    planted = planted_frame("vg2_wa_sn4", seed=3)
    observation = planted.observation
    blank = np.zeros(observation.image.shape, bool)
    blank[:, :180] = blank[:, 620:] = True
    image = np.where(blank, 0, observation.image).astype(np.float32)
    quality = np.where(blank, np.uint16(Quality.MISSING), observation.quality).astype(np.uint16)
    marks = find_marks(Observation(image, observation.noise, quality), planted.table)
    behind = (planted.xy[:, 0] < 174) | (planted.xy[:, 0] > 626)
    assert not marks.found[behind].any()
    assert (marks.state[behind & planted.inside] == MarkState.BLANK).all()
    shown = ~behind & planted.inside & (planted.xy[:, 0] > 184) & (planted.xy[:, 0] < 616)
    assert marks.found[shown].mean() > 0.97
    assert np.linalg.norm(marks.xy - planted.xy, axis=1)[marks.found].max() < 1.0


def test_black_sky_hides_marks_and_says_so() -> None:
    planted = planted_frame("vg1_na_sn7", seed=7, sky_dn=0.0, noise_dn=0.3)
    marks = find_marks(planted.observation, planted.table)
    from_centre = np.hypot(*(planted.xy - (450, 420)).T)
    on_disk, on_sky = from_centre < 222, from_centre > 236
    assert marks.found[on_disk].mean() > 0.95
    assert not marks.found[on_sky].any()
    assert (marks.state[on_sky & planted.inside] == MarkState.DARK).mean() > 0.9


@pytest.mark.parametrize("seed", range(4))
def test_no_mark_is_found_where_none_is(seed: int) -> None:
    rng = np.random.default_rng(seed)
    image = np.rint(disk_on_sky(rng, 12.0, 150.0) + rng.normal(0, 1.0, (800, 800)))
    image[rng.integers(0, 800, 400), rng.integers(0, 800, 400)] = 0  # dropouts, dark like marks but smaller
    plain = Observation(image.astype(np.float32), np.ones((800, 800), np.float32), np.zeros((800, 800), np.uint16))
    table = find_reseau_table("vg1_na_sn7")
    marks = find_marks(plain, table)
    assert not marks.found.any()
    assert np.array_equal(marks.xy, table.raw_xy)


def test_a_single_mark_is_fitted_without_bias() -> None:
    rng = np.random.default_rng(2)
    true = rng.uniform(20, 180, (1, 2)) + np.arange(60)[:, None] * [0.137, 0.411]
    errors = []
    for x, y in true:
        rows, columns = np.mgrid[0:200, 0:240].astype(np.float64)
        image = (40 + 0.2 * columns) * (1 - 0.9 * spot(columns - x, rows - y)[0]) + rng.normal(0, 0.5, rows.shape)
        observation = Observation(
            image.astype(np.float32), np.full(image.shape, 0.5, np.float32), np.zeros(image.shape, np.uint16)
        )
        fit = fit_marks(observation, np.array([[x, y]]) + rng.uniform(-1.5, 1.5, 2))
        errors.append(fit.xy[0] - (x, y))
    assert np.abs(np.mean(errors, axis=0)).max() < 0.005
    assert np.std(errors) < 0.03


def test_copied_first_columns_are_not_trusted() -> None:
    planted = planted_frame("vg2_na_sn5", seed=1)
    image = planted.observation.image.copy()
    image[:, :3] = image[:, 3:4]
    flagged = without_copied_edges(dataclasses.replace(planted.observation, image=image)).quality
    assert (flagged[:, :3] & Quality.MISSING).all()
    assert not (flagged[:, 3:] & Quality.MISSING).any()


def test_filled_marks_are_gone_and_flagged() -> None:
    planted = planted_frame("vg1_na_sn7", seed=19)
    marks = find_marks(planted.observation, planted.table)
    result = filled(planted.observation, marks)
    changed = (result.quality & Quality.RESEAU) != 0
    at = np.round(planted.xy[marks.found]).astype(int)
    assert changed[at[:, 1], at[:, 0]].all()
    assert np.array_equal(result.image[~changed], planted.observation.image[~changed])
    again = find_marks(result, planted.table)
    assert not again.found.any()
    assert 5000 < changed.sum() < 9000
