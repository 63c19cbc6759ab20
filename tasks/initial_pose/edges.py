"""Edges of brightness in a frame: where they are, and to which side they are bright."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.observation import Observation
from catalog.robust import sigma_about_zero
from tasks.compare.sky import with_even_sky

Array = NDArray[np.float64]

SMOOTH_PX = 1.2
# What is narrower than this is no body: stars, cosmic rays, hot pixels and columns.
SPECK_PX = 5
# Edges next to pixels without a value are those of the gap.
GAP_PX = 4
MOST_EDGES = 4000


@dataclass(frozen=True)
class Edges:
    """xy_px: (n, 2) in the frame. inward: (n, 2) unit vectors towards the bright side. strength: (n,) gradient, in
    units of brightness per pixel. clean: (ny, nx) image without specks, gaps filled, its sky even; usable: (ny, nx) far
    enough from gaps. dark, span: level of the frame's darkest parts and the brightness of its brightest above that;
    noise: 1-sigma of `clean`."""

    xy_px: Array
    inward: Array
    strength: Array
    clean: NDArray[np.float32]
    usable: NDArray[np.bool_]
    dark: float
    span: float
    noise: float


def edges_of(observation: Observation, edge_sigmas: float) -> Edges:
    """Maxima of the smoothed gradient along its direction that exceed `edge_sigmas` of the frame's noise and a share of
    the strongest; the strongest of them where there are very many."""
    import cv2

    clean, known = cleaned(observation)
    noise = float(np.median(observation.noise[observation.usable])) if observation.usable.any() else 0.0
    clean = with_even_sky(clean, known, noise)
    usable = cv2.erode(known.astype(np.uint8), np.ones((2 * GAP_PX + 1,) * 2, np.uint8), borderValue=1) > 0
    values = clean[known] if known.any() else np.zeros(1, np.float32)
    dark, bright = float(np.percentile(values, 2)), float(np.percentile(values, 99.7))
    smooth = cv2.GaussianBlur(clean, (0, 0), SMOOTH_PX)
    gx, gy = cv2.Scharr(smooth, cv2.CV_32F, 1, 0) / 32, cv2.Scharr(smooth, cv2.CV_32F, 0, 1) / 32
    size = np.hypot(gx, gy)
    spread = sigma_about_zero(gx[usable]) if usable.any() else 0.0
    by_noise = 0.3 * noise
    # In a frame full of markings the gradients' own scatter is no noise.
    floor = edge_sigmas * (min(spread, by_noise) if by_noise > 0 else spread)
    strongest = float(np.percentile(size[usable], 99.9)) if usable.any() else 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        ux, uy = gx / size, gy / size
    y, x = np.nonzero(usable & (size > max(floor, 0.08 * strongest, 1e-12)))
    ahead = values_at(size, x + ux[y, x], y + uy[y, x])
    behind = values_at(size, x - ux[y, x], y - uy[y, x])
    here = size[y, x]
    peak = (here >= ahead) & (here > behind)
    x, y, ahead, behind, here = x[peak], y[peak], ahead[peak], behind[peak], here[peak]
    curvature = ahead - 2 * here + behind
    along = np.where(curvature < 0, 0.5 * (behind - ahead) / np.minimum(curvature, -1e-12), 0.0).clip(-0.6, 0.6)
    inward = np.stack([ux[y, x], uy[y, x]], axis=1).astype(np.float64)
    xy = np.stack([x, y], axis=1) + along[:, None] * inward
    order = np.argsort(-here)[:MOST_EDGES] if len(here) > MOST_EDGES else np.arange(len(here))
    return Edges(
        xy[order], inward[order], here[order].astype(np.float64), clean, usable, dark, max(bright - dark, 1e-12), noise
    )


def cleaned(observation: Observation) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """The image (ny, nx) without specks, gaps filled from their surroundings, and where it has values. A saturated
    pixel has one: it is bright."""
    import cv2

    from catalog.observation import Quality

    known = observation.usable | ((observation.quality & Quality.SATURATED) > 0)
    known &= np.isfinite(observation.image)
    image = np.where(known, observation.image, 0).astype(np.float32)
    share = cv2.boxFilter(known.astype(np.float32), -1, (9, 9))
    around = cv2.boxFilter(image, -1, (9, 9)) / np.maximum(share, 1e-6)
    filled = np.where(known, image, np.where(share > 0, around, 0)).astype(np.float32)
    lowest = cv2.medianBlur(filled, SPECK_PX)
    # Only what sticks out of its surroundings is a speck; edges stay as sharp as they are.
    sticks = filled - lowest > 4 * np.maximum(observation.noise, 1e-6) + 0.3 * np.abs(lowest)
    return np.where(sticks, lowest, filled).astype(np.float32), known


def values_at(plane: NDArray[np.float32], x: Array, y: Array) -> NDArray[np.float32]:
    """Bilinear values (n,) of a plane (ny, nx) at pixels x, y (n,); beyond its border those of the border."""
    import cv2

    if len(x) == 0:
        return np.zeros(0, np.float32)
    u, v = (np.asarray(each, np.float32).reshape(-1, 1) for each in (x, y))
    out = np.empty(len(x), np.float32)
    for first in range(0, len(x), 30000):  # cv2.remap takes no more rows than a short integer counts
        part = slice(first, first + 30000)
        out[part] = cv2.remap(plane, u[part], v[part], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE).ravel()
    return out
