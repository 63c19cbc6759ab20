"""From sub-pixels to pixels: the blur by the PSF and the integral over square pixels, in one filter."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from tasks.compiled import compiled_reordered

Image = NDArray[np.float32]
Weights = NDArray[np.float64]

REACH_SIGMAS = 4.0


@lru_cache(maxsize=64)
def pixel_weights(oversample: int, psf_sigma_px: float) -> Weights:
    """Weights (n,) of the sub-pixels in a row about a pixel's middle: a Gaussian PSF seen through the pixel's box. Not
    to be written to."""
    box = np.full(oversample, 1 / oversample)
    sigma = psf_sigma_px * oversample
    if sigma <= 0:
        return box
    reach = round(REACH_SIGMAS * sigma + 0.5)
    gaussian = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2)
    return np.convolve(gaussian / gaussian.sum(), box)


def detect(fine: Image, oversample: int, psf_sigma_px: float) -> Image:
    """Blur a sub-pixel image (ny*s, nx*s) by a Gaussian PSF and integrate it over square pixels to (ny, nx)."""
    if oversample == 1 and psf_sigma_px > 0:
        import cv2

        return cv2.GaussianBlur(fine, (0, 0), psf_sigma_px, borderType=cv2.BORDER_REPLICATE)
    weights = pixel_weights(oversample, float(psf_sigma_px))
    return filtered(fine, weights, weights, oversample)


def filtered(fine: Image, along_y: Weights, along_x: Weights, oversample: int) -> Image:
    """Weighted sums (ny, nx) of the sub-pixels (ny*s, nx*s) about each pixel's middle, by the product of weights (n,)
    along y and x; n - s must be even. Edges are replicated."""
    if len(along_y) == len(along_x) == oversample == 1:
        return fine
    rows, columns = (np.ascontiguousarray(weights, np.float32) for weights in (along_y, along_x))
    return np.asarray(_filtered(np.ascontiguousarray(fine, np.float32), rows, columns, oversample))


@compiled_reordered
def _filtered(fine, along_y, along_x, oversample):  # type: ignore[no-untyped-def]
    rows, columns = fine.shape
    ny, nx = rows // oversample, columns // oversample
    taps_y, taps_x = len(along_y), len(along_x)
    above, before = (taps_y - oversample) // 2, (taps_x - oversample) // 2
    out = np.zeros((ny, nx), np.float32)
    line = np.zeros(columns + 2 * before, np.float32)
    # The sky beside the target, and its night, are zero: only what lies between each row's first and last value counts.
    firsts, lasts = np.empty(rows, np.int64), np.empty(rows, np.int64)
    for k in range(rows):
        first, last = 0, columns
        while first < last and fine[k, first] == 0:
            first += 1
        while last > first and fine[k, last - 1] == 0:
            last -= 1
        firsts[k], lasts[k] = (first, last) if first < last else (columns, 0)
    for i in range(ny):
        sums = line[before : before + columns]
        top = i * oversample - above
        first, last = columns, 0
        for k in range(max(top, 0), min(top + taps_y, rows)):
            first, last = min(first, firsts[k]), max(last, lasts[k])
        if top < 0:
            first, last = min(first, firsts[0]), max(last, lasts[0])
        if top + taps_y > rows:
            first, last = min(first, firsts[rows - 1]), max(last, lasts[rows - 1])
        if first >= last:
            continue
        line[:] = 0
        # From 0 on, so that the compiler sees that no index is negative; four rows at a time: the sums are read and
        # written a quarter as often.
        part, size = sums[first:last], last - first
        for k in range(0, taps_y - taps_y % 4, 4):
            a = fine[min(max(top + k, 0), rows - 1), first:last]
            b = fine[min(max(top + k + 1, 0), rows - 1), first:last]
            c = fine[min(max(top + k + 2, 0), rows - 1), first:last]
            d = fine[min(max(top + k + 3, 0), rows - 1), first:last]
            wa, wb, wc, wd = along_y[k], along_y[k + 1], along_y[k + 2], along_y[k + 3]
            for j in range(size):
                part[j] += wa * a[j] + wb * b[j] + wc * c[j] + wd * d[j]
        for k in range(taps_y - taps_y % 4, taps_y):
            a, wa = fine[min(max(top + k, 0), rows - 1), first:last], along_y[k]
            for j in range(size):
                part[j] += wa * a[j]
        line[:before] = sums[0]
        line[before + columns :] = sums[columns - 1]
        # Pixels whose weights reach what is not zero; at the frame's ends that is replicated.
        begin = 0 if first == 0 else max((first + before - taps_x) // oversample, 0)
        end = nx if last == columns else min((last + before) // oversample + 1, nx)
        found, seen = out[i, begin:end], line[begin * oversample :]
        for j in range(len(found)):
            total, near = np.float32(0), seen[j * oversample : j * oversample + taps_x]
            for k in range(taps_x):
                total += along_x[k] * near[k]
            found[j] = total
    return out
