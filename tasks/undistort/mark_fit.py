"""Sub-pixel least squares fit of reseau marks: a small dark spot on a smoothly varying background."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.observation import Observation, Quality
from catalog.robust import MAD_TO_SIGMA, huber_weight

WINDOW_PX = 6  # half width of the fitted window
SPOT_SIGMA_PX = 1.23  # measured on stacked marks of four frames: 1.20-1.36, power 2.4-3.0
SPOT_POWER = 2.7
CORE_PX = 3.2
STEPS = 25
LARGEST_STEP_PX = 0.5
HUBER = 2.5
SETTLED_PX = 1e-3

Array = NDArray[np.float64]


@dataclass(frozen=True)
class MarkFit:
    """xy (n, 2): fitted centres. depth (n,): fraction of the light that the mark takes. sigma_px (n,): 1-sigma of one
    coordinate. likeness (n,): correlation of the pixels with the fitted spot, background removed. visible (n,):
    fraction of the core's pixels that are usable. contrast (n,): background over its noise."""

    xy: Array
    depth: Array
    sigma_px: Array
    likeness: Array
    visible: Array
    contrast: Array


def spot(dx: Array, dy: Array) -> tuple[Array, Array, Array]:
    """Profile of a mark, 1 at its centre, and its derivatives along dx and dy."""
    squared = (dx**2 + dy**2) / SPOT_SIGMA_PX**2
    profile = np.exp(-0.5 * squared ** (SPOT_POWER / 2))
    slope = -0.5 * SPOT_POWER * np.maximum(squared, 1e-12) ** (SPOT_POWER / 2 - 1) * profile / SPOT_SIGMA_PX**2
    return profile, slope * dx, slope * dy


def fit_marks(observation: Observation, start_xy: Array) -> MarkFit:
    """Fit image = (quadratic background) (1 - depth spot(x - x0, y - y0)) around each start (n, 2), robustly (Huber).

    All marks at once by Gauss-Newton. Pixels that are missing, or outside the frame, have no weight.
    """
    windows = _Windows(observation, start_xy)
    offset, depth = start_xy - windows.corner, np.full(len(start_xy), 0.9)
    background = windows.background_without_core(offset)
    for _ in range(STEPS):
        residual, jacobian = windows.linearised(offset, depth, background)
        weight = windows.weight * _huber(residual, windows.weight)
        normal = _normal(jacobian, weight)
        step = np.linalg.solve(normal, _moment(jacobian, weight, residual))[..., 0]
        move = np.clip(step[:, :2], -LARGEST_STEP_PX, LARGEST_STEP_PX)
        offset, depth = offset + move, np.clip(depth + step[:, 2], 0.0, 2.0)
        background = background + step[:, 3:]
        if np.abs(move).max(initial=0) < SETTLED_PX:
            break
    return windows.assessed(offset, depth, background)


def _normal(jacobian: Array, weight: Array) -> Array:
    normal = np.swapaxes(jacobian * weight[..., None], 1, 2) @ jacobian
    damping = 1e-6 * np.trace(normal, axis1=1, axis2=2) / normal.shape[1] + 1e-9
    return np.asarray(normal + damping[:, None, None] * np.eye(normal.shape[1]))


def _moment(jacobian: Array, weight: Array, values: Array) -> Array:
    return np.asarray(np.swapaxes(jacobian, 1, 2) @ (weight * values)[..., None])


def _huber(residual: Array, weight: Array) -> Array:
    pull = np.abs(residual) * np.sqrt(weight)
    unseen = (weight <= 0).sum(axis=1)  # their zeros come first when sorted: skip them on the way to the median
    middle = (unseen + pull.shape[1]) // 2
    scale = MAD_TO_SIGMA * np.take_along_axis(
        np.sort(pull, axis=1), np.minimum(middle, pull.shape[1] - 1)[:, None], axis=1
    )
    return np.asarray(huber_weight(pull, HUBER * np.maximum(scale, 0.5)))


class _Windows:
    """The pixels around each mark as (n, k) arrays."""

    def __init__(self, observation: Observation, start_xy: Array) -> None:
        side = np.arange(-WINDOW_PX, WINDOW_PX + 1)
        dy, dx = (plane.ravel().astype(np.float64) for plane in np.meshgrid(side, side, indexing="ij"))
        self.dx, self.dy = dx, dy
        self.corner = np.round(start_xy)
        columns, rows = (self.corner[:, :1] + dx).astype(int), (self.corner[:, 1:] + dy).astype(int)
        height, width = observation.image.shape
        inside = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
        at = (np.clip(rows, 0, height - 1), np.clip(columns, 0, width - 1))
        good = inside & ((observation.quality[at] & (Quality.MISSING | Quality.OUTSIDE_WINDOW)) == 0)
        self.pixels = np.nan_to_num(observation.image[at].astype(np.float64))
        self.noise = np.maximum(observation.noise[at].astype(np.float64), 1e-6)
        self.weight = good / self.noise**2
        x, y = dx / WINDOW_PX, dy / WINDOW_PX
        self.terms = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=-1)

    def in_core(self, offset: Array) -> NDArray[np.bool_]:
        return np.hypot(self.dx - offset[:, :1], self.dy - offset[:, 1:]) < CORE_PX

    def background_without_core(self, offset: Array) -> Array:
        weight = self.weight * ~self.in_core(offset)
        jacobian = np.broadcast_to(self.terms, (len(offset), *self.terms.shape))
        moment = _moment(jacobian, weight, self.pixels)
        return np.asarray(np.linalg.solve(_normal(jacobian, weight), moment)[..., 0])

    def linearised(self, offset: Array, depth: Array, background: Array) -> tuple[Array, Array]:
        """Residual (n, k) and derivatives (n, k, 9) along x0, y0, depth and the six background terms."""
        profile, along_x, along_y = spot(self.dx - offset[:, :1], self.dy - offset[:, 1:])
        light = background @ self.terms.T
        shade = 1.0 - depth[:, None] * profile
        spot_columns = np.stack(
            [light * depth[:, None] * along_x, light * depth[:, None] * along_y, -light * profile], -1
        )
        return self.pixels - light * shade, np.concatenate([spot_columns, self.terms * shade[..., None]], axis=-1)

    def assessed(self, offset: Array, depth: Array, background: Array) -> MarkFit:
        residual, jacobian = self.linearised(offset, depth, background)
        weight = self.weight * _huber(residual, self.weight)
        freedom = np.maximum((self.weight > 0).sum(axis=1) - jacobian.shape[2], 1)
        chi2 = np.maximum((weight * residual**2).sum(axis=1) / freedom, 1.0)
        covariance = np.linalg.inv(_normal(jacobian, weight))
        variance = 0.5 * (covariance[:, 0, 0] + covariance[:, 1, 1]) * chi2
        core = self.in_core(offset)
        usable = (self.weight > 0) & core
        noise = np.median(self.noise, axis=1)
        return MarkFit(
            xy=self.corner + offset,
            depth=depth,
            sigma_px=np.sqrt(np.abs(variance)),
            likeness=self._likeness(offset, background),
            visible=usable.sum(axis=1) / np.maximum(core.sum(axis=1), 1),
            contrast=background[:, 0] / noise,
        )

    def _likeness(self, offset: Array, background: Array) -> Array:
        profile, *_ = spot(self.dx - offset[:, :1], self.dy - offset[:, 1:])
        missing_light = background @ self.terms.T - self.pixels
        weight = (self.weight > 0) & (np.hypot(self.dx - offset[:, :1], self.dy - offset[:, 1:]) < CORE_PX + 1.0)
        total = np.maximum(weight.sum(axis=1, keepdims=True), 1)
        a, b = (plane - (plane * weight).sum(axis=1, keepdims=True) / total for plane in (profile, missing_light))
        norm = np.sqrt((a * a * weight).sum(axis=1) * (b * b * weight).sum(axis=1))
        return np.asarray((a * b * weight).sum(axis=1) / np.maximum(norm, 1e-12))
