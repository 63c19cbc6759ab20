"""Displacement field between two pictures of the same scene in the same frame, by local correlation."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

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
        a, b = patch - patch.mean(), moved - moved.mean()
        spread = float(np.sqrt((a * a).sum() * (b * b).sum()))
        if spread == 0:
            return shift, 0.0
        likeness = float((a * b).sum() / spread)
        gain = np.sqrt((a * a).sum() / (b * b).sum())
        down, across = np.gradient(0.5 * (a + gain * b))
        design = np.stack([across.ravel(), down.ravel(), b.ravel(), np.ones(b.size)], axis=1)
        difference = (a - gain * b).ravel()
        step = np.linalg.lstsq(design, difference, rcond=None)[0][:2]
        shift = shift + np.clip(step, -0.5, 0.5)
        weakest = np.linalg.eigvalsh(design[:, :2].T @ design[:, :2])[0]
        sigma_px = np.sqrt(difference.var() * CORRELATED_PIXELS / max(float(weakest), 1e-12))
        if np.abs(step).max() < 1e-3:
            break
    sure = sigma_px <= LARGEST_SIGMA_PX and np.abs(shift - start).max() < 1.5
    return shift, likeness if sure else 0.0
