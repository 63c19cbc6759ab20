"""Optical flow: where each template of the simulation lies in the image (paper, section 5.1)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Flow:
    """displacement: (ny, nx, 2) px, (x, y), from simulation to image. correlation: (ny, nx) of the best match, -1..1.
    places: (ny, nx) where the template has texture and the search box lies on usable pixels. valid: those of them whose
    best match is inside the search."""

    displacement: NDArray[np.float32]
    correlation: NDArray[np.float32]
    places: NDArray[np.bool_]
    valid: NDArray[np.bool_]


def optical_flow(
    image: NDArray[np.float32],
    simulation: NDArray[np.float32],
    usable: NDArray[np.bool_],
    template_px: int = 13,
    search_px: int = 21,
    min_texture: float = 0.0,
) -> Flow:
    """Normalised cross-correlation (paper, eq. 13) of the `template_px` box around every pixel of the simulation with
    every place inside the `search_px` box of the image, refined to a fraction of a pixel by paraboloids.

    image, simulation, usable: (ny, nx); min_texture: smallest standard deviation of a template. All templates are done
    at once: the sums of a box are box filters, one for each of the (search - template + 1)^2 displacements.
    Raises ValueError for even boxes or a search box that is not larger than the template.
    """
    if template_px % 2 == 0 or search_px % 2 == 0 or search_px <= template_px:
        raise ValueError(f"boxes must be odd and the search larger than the template: {template_px}, {search_px}")
    reach = (search_px - template_px) // 2
    scale = float(np.std(image[usable])) if usable.any() else 1.0
    t = simulation - np.float32(np.mean(simulation))
    f = np.where(usable, image - np.float32(np.mean(image[usable]) if usable.any() else 0), 0).astype(np.float32)
    t, f = t / np.float32(scale or 1.0), f / np.float32(scale or 1.0)
    mean_t, mean_f = box_mean(t, template_px), box_mean(f, template_px)
    var_t = np.maximum(box_mean(t * t, template_px) - mean_t**2, 0)
    var_f = np.maximum(box_mean(f * f, template_px) - mean_f**2, 0)
    size = 2 * reach + 1
    scores = np.empty((size, size, *t.shape), np.float32)
    wide = [np.pad(a, reach, mode="edge") for a in (f, mean_f, 1 / np.sqrt(np.maximum(var_f, 1e-6)))]
    inverse_t = 1 / np.sqrt(np.maximum(var_t, 1e-6))
    ny, nx = t.shape
    for i in range(size):
        for j in range(size):
            moved_f, moved_mean, inverse_f = (a[i : i + ny, j : j + nx] for a in wide)
            covariance = box_mean(t * moved_f, template_px)
            covariance -= mean_t * moved_mean
            covariance *= inverse_t
            np.multiply(covariance, inverse_f, out=scores[i, j])
    displacement, correlation, inside = peaks(scores, reach)
    clear = box_mean(usable.astype(np.float32), search_px) > 1 - 1e-4
    textured = np.sqrt(var_t) * scale > max(min_texture, 1e-6 * scale)
    places = clear & textured & away_from_edge(t.shape, search_px)
    return Flow(displacement, correlation, places, places & inside)


def box_mean(a: NDArray[np.float32], side: int) -> NDArray[np.float32]:
    """Mean over a centred square box."""
    import cv2

    return cv2.boxFilter(a, cv2.CV_32F, (side, side), borderType=cv2.BORDER_REPLICATE)


def away_from_edge(shape: tuple[int, int], search_px: int) -> NDArray[np.bool_]:
    """Pixels whose search box lies in the frame."""
    mask = np.zeros(shape, bool)
    half = search_px // 2
    mask[half : shape[0] - half, half : shape[1] - half] = True
    return mask


def peaks(
    scores: NDArray[np.float32], reach: int
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_]]:
    """Best displacement (ny, nx, 2) with its sub-pixel part, its score, and whether it is off the search's edge."""
    size = 2 * reach + 1
    flat = scores.reshape(size * size, *scores.shape[2:])
    best = np.argmax(flat, axis=0)
    row, column = best // size, best % size
    inside = (row > 0) & (row < size - 1) & (column > 0) & (column < size - 1)
    r, c = np.clip(row, 1, size - 2), np.clip(column, 1, size - 2)

    def score(dr: int, dc: int) -> NDArray[np.float32]:
        return np.take_along_axis(flat, ((r + dr) * size + c + dc)[None], axis=0)[0]

    dx, dy = paraboloid_peak({(i, j): score(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1)})
    displacement = np.stack([c - reach + dx, r - reach + dy], axis=-1).astype(np.float32)
    return displacement, np.take_along_axis(flat, best[None], axis=0)[0], inside


def paraboloid_peak(score: dict[tuple[int, int], NDArray]) -> tuple[NDArray, NDArray]:
    """Place (x, y) of the maximum of a paraboloid through the values at (row, column) steps of -1, 0, 1, within a step.

    Its mixed term matters: ridges that run across both axes draw two separate parabolas 0.1 px towards whole pixels.
    Zero where the values have no maximum.
    """
    here = score[0, 0]
    slope_x, slope_y = (score[0, 1] - score[0, -1]) / 2, (score[1, 0] - score[-1, 0]) / 2
    xx, yy = score[0, 1] - 2 * here + score[0, -1], score[1, 0] - 2 * here + score[-1, 0]
    xy = (score[1, 1] - score[1, -1] - score[-1, 1] + score[-1, -1]) / 4
    determinant = xx * yy - xy**2
    peaked = (determinant > 1e-12) & (xx < 0)
    x, y = (
        np.divide(top, determinant, out=np.zeros_like(here), where=peaked)
        for top in (xy * slope_y - yy * slope_x, xy * slope_x - xx * slope_y)
    )
    return np.clip(x, -1, 1), np.clip(y, -1, 1)
