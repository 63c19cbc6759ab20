"""Displacement field between two pictures of the same scene in the same frame, by local correlation."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tasks.compiled import compiled
from tasks.undistort.mark_set import MarkSet
from tasks.undistort.smooth_model import SmoothModel
from tasks.undistort.thin_plate import fit_thin_plate

WINDOW_PX = 41
STEP_PX = 20
REACH_PX = 8
LIKENESS_NEEDED = 0.7
LARGEST_SIGMA_PX = 0.1
CORRELATED_PIXELS = 9.0  # what differs between two products (texture, calibration) is correlated over about 3x3
REFINING_STEPS = 12
USABLE_FRACTION = 0.97
RESIDUAL_DEGREE = 3
WINDOW_SIGMA_PX = 0.3  # neighbouring windows overlap, so each counts less than a mark

Array = NDArray[np.float64]


@dataclass(frozen=True)
class DisplacementField:
    """xy (n, 2): window centres in the first image. shift_px (n, 2): where the same patch lies in the second, minus xy.
    likeness (n,): correlation coefficient of the patches."""

    xy: Array
    shift_px: Array
    likeness: Array

    def summary(self) -> dict[str, Any]:
        """Plain numbers: windows, mean shift, and the length of the shifts as median and 95th percentile, with and
        without the mean."""
        if not len(self.xy):
            return {"windows": 0}
        mean = self.shift_px.mean(axis=0)
        length, about_mean = (np.linalg.norm(v, axis=1) for v in (self.shift_px, self.shift_px - mean))
        return {
            "windows": len(self.xy),
            "mean_px": mean.tolist(),
            "median_px": float(np.median(length)),
            "p95_px": float(np.percentile(length, 95)),
            "median_about_mean_px": float(np.median(about_mean)),
            "p95_about_mean_px": float(np.percentile(about_mean, 95)),
        }


def residual_model(field: DisplacementField, size_px: tuple[int, int], degree: int = RESIDUAL_DEGREE) -> SmoothModel:
    """Distortion that is left in the second image of a displacement field, the first taken for true: the thin plate
    through the measured shifts. `resampled` with it corrects the second image.

    Raises RefusedError when too few windows could be measured.
    """
    there = np.ones(len(field.xy), dtype=bool)
    marks = MarkSet(field.xy + field.shift_px, field.xy, WINDOW_SIGMA_PX * there, there, ~there, size_px, size_px)
    return fit_thin_plate(marks, degree)


def displacement_field(
    first: NDArray[np.float32],
    second: NDArray[np.float32],
    usable: NDArray[np.bool_],
    window_px: int = WINDOW_PX,
    step_px: int = STEP_PX,
) -> DisplacementField:
    """Measure where each patch of `first` (ny, nx) lies in `second` (ny, nx), both in the same frame.

    usable (ny, nx): pixels that count in both; windows with fewer than 97 % of them are left out. Normalised
    cross-correlation finds the whole pixel within `REACH_PX`, least squares on shift, gain and offset the rest. Patches
    that correlate less than `LIKENESS_NEEDED`, or whose shift is uncertain by more than `LARGEST_SIGMA_PX` in some
    direction (along a bare limb), are left out. Gain and offset may differ between the images.
    """
    import cv2

    half = window_px // 2
    share = cv2.blur(usable.astype(np.float32), (window_px, window_px))
    margin = half + REACH_PX + 2
    rows, columns = first.shape
    found: list[tuple[Array, Array, float]] = []
    for y in range(margin, rows - margin, step_px):
        for x in range(margin, columns - margin, step_px):
            if share[y, x] >= USABLE_FRACTION:
                shift, likeness = _shift_of_patch(first, second, x, y, half)
                if likeness >= LIKENESS_NEEDED:
                    found.append((np.array([x, y], dtype=np.float64), shift, likeness))
    if not found:
        return DisplacementField(np.empty((0, 2)), np.empty((0, 2)), np.empty(0))
    return DisplacementField(*(np.array(part) for part in zip(*found, strict=True)))


def _shift_of_patch(
    first: NDArray[np.float32], second: NDArray[np.float32], x: int, y: int, half: int
) -> tuple[Array, float]:
    import cv2

    patch = np.ascontiguousarray(first[y - half : y + half + 1, x - half : x + half + 1])
    reach = half + REACH_PX
    around = np.ascontiguousarray(second[y - reach : y + reach + 1, x - reach : x + reach + 1])
    if patch.std() == 0 or around.std() == 0:
        return np.zeros(2), 0.0
    score = cv2.matchTemplate(around, patch, cv2.TM_CCOEFF_NORMED)
    _, _, _, (column, row) = cv2.minMaxLoc(score)
    whole = np.array([column - REACH_PX, row - REACH_PX], dtype=np.float64)
    return _refined(patch, second, np.array([x, y]), whole)


def _refined(patch: NDArray[np.float32], second: NDArray[np.float32], at: Array, shift: Array) -> tuple[Array, float]:
    """Least squares of patch = gain * second(shifted) + offset; the slope is the mean of both images', so that neither
    interpolation nor noise favours one of them."""
    import cv2

    size = (patch.shape[1], patch.shape[0])
    start = shift
    likeness, sigma_px = 0.0, np.inf
    for _ in range(REFINING_STEPS):
        place = at + shift
        moved = cv2.getRectSubPix(second, size, (float(place[0]), float(place[1])))
        likeness, weakest, variance, normal, right = _equations(patch, moved)
        if weakest < 0:
            return shift, 0.0
        step = np.linalg.lstsq(normal, right, rcond=None)[0][:2]
        shift = shift + np.clip(step, -0.5, 0.5)
        sigma_px = np.sqrt(variance * CORRELATED_PIXELS / max(weakest, 1e-12))
        if np.abs(step).max() < 1e-3:
            break
    sure = sigma_px <= LARGEST_SIGMA_PX and np.abs(shift - start).max() < 1.5
    return shift, likeness if sure else 0.0


@compiled
def _equations(patch: NDArray[np.float32], moved: NDArray[np.float32]) -> tuple[float, float, float, Array, Array]:
    """Of two pictures (ny, nx) of the same place: their correlation; the smallest eigenvalue of the products of the
    slopes along x and y, negative where one of the pictures is even; the variance of their difference, with the second
    scaled to the first; and the normal equations, (4, 4) and (4,), of shift in x and y, gain and offset."""
    rows, columns = patch.shape
    size = rows * columns
    a, b = patch.astype(np.float64), moved.astype(np.float64)
    a -= a.mean()
    b -= b.mean()
    aa, bb, ab = (a * a).sum(), (b * b).sum(), (a * b).sum()
    normal, right = np.zeros((4, 4)), np.zeros(4)
    if aa * bb == 0:
        return 0.0, -1.0, 0.0, normal, right
    gain = np.sqrt(aa / bb)
    mean = 0.5 * (a + gain * b)
    one = np.ones(4)
    differences, squares = 0.0, 0.0
    for y in range(rows):
        above, below = max(y - 1, 0), min(y + 1, rows - 1)
        for x in range(columns):
            left, right_of = max(x - 1, 0), min(x + 1, columns - 1)
            one[0] = (mean[y, right_of] - mean[y, left]) / (right_of - left)
            one[1] = (mean[below, x] - mean[above, x]) / (below - above)
            one[2] = b[y, x]
            difference = a[y, x] - gain * b[y, x]
            differences += difference
            squares += difference * difference
            for i in range(4):
                right[i] += one[i] * difference
                for j in range(i + 1):
                    normal[i, j] += one[i] * one[j]
    for i in range(4):
        for j in range(i):
            normal[j, i] = normal[i, j]
    half, apart = (normal[0, 0] + normal[1, 1]) / 2, (normal[0, 0] - normal[1, 1]) / 2
    weakest = max(half - np.sqrt(apart * apart + normal[0, 1] * normal[0, 1]), 0.0)
    variance = squares / size - (differences / size) ** 2
    return ab / np.sqrt(aa * bb), weakest, variance, normal, right
