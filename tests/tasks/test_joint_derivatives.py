"""What the pixels make of sub-pixels, and of a picture that is displaced, scaled, rolled or blurred."""

import cv2
import numpy as np
import pytest

from tasks.joint.derivatives import changes_of_place
from tasks.joint.parameters import NAMES, PSF, RANGE, ROLL
from tasks.simulate.pixels import detect, filtered, pixel_weights

SIZE, PSF_PX = (44, 52), 0.8
CENTRE = np.array([24.3, 20.6])
STEP = 1e-2


def picture(s: int, move: tuple[float, float] = (0.0, 0.0), growth: float = 0.0, roll_deg: float = 0.0) -> np.ndarray:
    """A smooth blob that is no disk, on the sub-pixels of a window, moved about CENTRE."""
    y, x = ((np.indices((SIZE[0] * s, SIZE[1] * s)) + 0.5) / s - 0.5).astype(np.float64)
    x, y = x - CENTRE[0] - move[0], y - CENTRE[1] - move[1]
    turn = np.radians(roll_deg)
    x, y = (np.cos(turn) * x + np.sin(turn) * y), (np.cos(turn) * y - np.sin(turn) * x)
    x, y = x / (1 + growth), y / (1 + growth)
    blob = np.exp(-(((x - 2) / 7) ** 2) - ((y + 1) / 4) ** 2) + 0.5 * np.exp(-(((x + 5) / 3) ** 2) - ((y - 4) / 6) ** 2)
    return blob.astype(np.float32)


def half_difference(ahead: np.ndarray, back: np.ndarray, s: int, blur: float = 0.0) -> np.ndarray:
    """Of the pixels of two pictures, a step ahead and one back."""
    wide, narrow = PSF_PX * np.exp(blur), PSF_PX * np.exp(-blur)
    return np.asarray((detect(ahead, s, wide) - detect(back, s, narrow)) / (2 * STEP))


@pytest.mark.parametrize("s", [2, 3, 4])
@pytest.mark.parametrize("where", ["inside", "left", "right", "top", "bottom", "everywhere", "nowhere", "dots"])
def test_the_filter_is_the_weighted_sum_wherever_the_picture_is_dark(s: int, where: str) -> None:
    """Only what is not zero is gone through; the edges are replicated."""
    ny, nx = 14, 17
    fine = np.random.default_rng(s).random((ny * s, nx * s)).astype(np.float32)
    kept = {
        "inside": np.s_[5 * s : 8 * s, 4 * s + 1 : 9 * s],
        "left": np.s_[2 * s : 9 * s, :3],
        "right": np.s_[2 * s : 9 * s, -3:],
        "top": np.s_[:2, 5 * s : 7 * s],
        "bottom": np.s_[-2:, 5 * s : 7 * s],
        "everywhere": np.s_[:, :],
        "nowhere": np.s_[:0, :0],
        "dots": np.s_[:: 5 * s, :: 6 * s],
    }[where]
    picture = np.zeros_like(fine)
    picture[kept] = fine[kept]
    along_y, along_x = pixel_weights(s, 0.6), np.diff(pixel_weights(s, 0.9), prepend=0, append=0)[:-1]
    along_x = along_x[: len(along_x) - (len(along_x) - s) % 2]
    padded = np.pad(picture.astype(np.float64), [((len(w) - s) // 2,) * 2 for w in (along_y, along_x)], mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, (len(along_y), len(along_x)))[::s, ::s]
    expected = np.einsum("ijkl,k,l->ij", windows, along_y, along_x)
    assert filtered(picture, along_y, along_x, s) == pytest.approx(expected, abs=1e-5)


@pytest.mark.parametrize(("s", "tolerance"), [(1, 0.1), (2, 0.02), (5, 0.01)])
def test_changes_are_the_differences_of_moved_pictures(s: int, tolerance: float) -> None:
    changes = np.zeros((len(NAMES), *SIZE), np.float32)
    changes_of_place(picture(s), CENTRE, s, PSF_PX, changes)
    wanted = {
        0: half_difference(picture(s, move=(STEP, 0)), picture(s, move=(-STEP, 0)), s),
        1: half_difference(picture(s, move=(0, STEP)), picture(s, move=(0, -STEP)), s),
        # Farther away, the disk is smaller.
        RANGE: half_difference(picture(s, growth=-STEP), picture(s, growth=STEP), s),
        ROLL: half_difference(picture(s, roll_deg=STEP), picture(s, roll_deg=-STEP), s),
        PSF: half_difference(picture(s), picture(s), s, blur=STEP),
    }
    for number, expected in wanted.items():
        # Slopes are differences of neighbouring sub-pixels: coarse ones flatten them.
        assert np.abs(changes[number] - expected).max() < tolerance * np.abs(expected).max()


@pytest.mark.parametrize(("s", "sigma_px"), [(2, 0.7), (3, 1.6), (5, 0.6)])
def test_the_filter_blurs_and_integrates_as_two_steps_would_up_to_the_edge(s: int, sigma_px: float) -> None:
    fine = np.random.default_rng(0).random((SIZE[0] * s, SIZE[1] * s), dtype=np.float32)
    blurred = cv2.GaussianBlur(fine, (0, 0), sigma_px * s, borderType=cv2.BORDER_REPLICATE)
    boxes = blurred.reshape(SIZE[0], s, SIZE[1], s).mean(axis=(1, 3))
    assert detect(fine, s, sigma_px) == pytest.approx(boxes, abs=3e-5)


def test_rows_and_columns_have_weights_of_their_own() -> None:
    fine = np.random.default_rng(1).random((12, 15), dtype=np.float32)
    found = filtered(fine, np.array([0.0, 1.0, 0.0]), np.array([0.5, 0.25, 0.25]), 3)
    assert found == pytest.approx(fine[1::3].reshape(4, 5, 3) @ [0.5, 0.25, 0.25], abs=1e-6)
