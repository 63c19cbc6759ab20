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
    """Normalised cross-correlation (paper, eq. 11) of the `template_px` box around every pixel of the simulation with
    every place inside the `search_px` box of the image, refined to a fraction of a pixel by paraboloids.

    image, simulation, usable: (ny, nx); min_texture: smallest standard deviation of a template. The sums of
    all boxes are kept up to date along rows and columns, for each of the (search - template + 1)^2 displacements.
    Raises ValueError for even boxes or a search box that is not larger than the template.
    """
    from tasks.attitude.flow_loop import best_displacements

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
    f, mean_f, inverse_f = (np.pad(a, reach, mode="edge") for a in (f, mean_f, one_over_root(var_f)))
    displacement, correlation, inside = best_displacements(
        t, mean_t, one_over_root(var_t), f, mean_f, inverse_f, template_px, reach
    )
    clear = box_mean(usable.astype(np.float32), search_px) > 1 - 1e-4
    textured = np.sqrt(var_t) * scale > max(min_texture, 1e-6 * scale)
    places = clear & textured & away_from_edge(t.shape, search_px)
    return Flow(displacement, correlation, places, places & inside)


def box_mean(a: NDArray[np.float32], side: int) -> NDArray[np.float32]:
    """Mean over a centred square box."""
    import cv2

    return cv2.boxFilter(a, cv2.CV_32F, (side, side), borderType=cv2.BORDER_REPLICATE)


def one_over_root(variance: NDArray[np.float32]) -> NDArray[np.float32]:
    """One over the standard deviation, which is held above 0.001."""
    return np.asarray(1 / np.sqrt(np.maximum(variance, np.float32(1e-6))), np.float32)


def away_from_edge(shape: tuple[int, int], search_px: int) -> NDArray[np.bool_]:
    """Pixels whose search box lies in the frame."""
    mask = np.zeros(shape, bool)
    half = search_px // 2
    mask[half : shape[0] - half, half : shape[1] - half] = True
    return mask
