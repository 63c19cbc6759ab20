"""The limb along a disk that was found: where brightness falls fastest outward, and the ellipse through it."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from catalog.robust import sigma_about_zero
from catalog.target import Target
from tasks.initial_pose.disk import Disk
from tasks.initial_pose.edges import Edges, values_at

Array = NDArray[np.float64]

# How far beside the circle the limb is looked for, at first and at last: pixels, and share of its radius.
REACH_PX, REACH_SHARE = (6.0, 4.0, 3.0), (0.08, 0.04, 0.02)
STEP_PX, SMOOTH_PX = 0.5, 1.0
# The least fall of brightness: sigmas of the noise, and share of the frame's span.
FALL_SIGMAS, FALL_SHARE = 4.0, 0.03
FEWEST_POINTS, MOST_POINTS = 8, 1440
# Points beside each other err together over so many of them.
TOGETHER = 8.0
# By law and blur the brightness falls fastest inside the true limb, 1-sigma of centre and radius: of a Lambert sphere
# seen from the Sun's side by 1.3 px, of one whose limb is bright by 0.2 px or less (blur 0.9 px).
CENTRE_PX, RADIUS_PX = 0.3, 0.8
# The limb's lit half, without its ends, where limb and terminator meet.
LIT_COSINE = 0.15
# A body's flattening is solved for where it moves the limb by more than this.
ROUND_PX = 0.5
# 1-sigma of a radius by a trajectory's range, relative: what blur and law do to an edge is in the limb's own error.
KNOWN_SIGMA = 0.003


@dataclass(frozen=True)
class Limb:
    """centre_px: (2,) of the ellipse; semi_px: its larger half axis; flattening: (2,), one less the ratio of the axes
    times cosine and sine of twice the larger one's position angle (from +x towards +y). covariance: (3, 3) of centre,
    px, and logarithm of the half axis. points_px: (n, 2) seen edges of the lit limb, arc_deg: how much of the circle
    they cover; residual_px: their robust scatter about it."""

    centre_px: Array
    semi_px: float
    flattening: Array
    covariance: Array
    points_px: Array
    arc_deg: float
    residual_px: float

    @property
    def arc_sigma(self) -> float:
        """1-sigma of the radius, relative, that the extent and the scatter of the seen limb leave; `covariance` has in
        it what law and blur add, whatever is seen of it."""
        of_edge = RADIUS_PX / self.mean_px
        return float(np.sqrt(max(self.covariance[2, 2] - of_edge**2, 0.0)))

    def with_error(self, centre_px: float, radius_px: float) -> "Limb":
        """The same limb, each coordinate of its centre and its radius known no better than to so many pixels."""
        more = np.diag([centre_px, centre_px, radius_px / self.mean_px]) ** 2
        return replace(self, covariance=self.covariance + more)

    @property
    def mean_px(self) -> float:
        """Radius of the circle of the same area."""
        return self.semi_px * float(np.sqrt(1 - np.hypot(*self.flattening)))


def limb_along(
    edges: Edges, disk: Disk, target: Target, lit_from_deg: float | None = None, radius_px: float | None = None
) -> Limb | None:
    """The limb near a disk; None where too little of one is seen. The ellipse is no flatter than the target.

    lit_from_deg: position angle that the light comes from; then only the limb's half on that side counts, for on the
    on the other one the terminator is the edge that is seen. radius_px: of the larger half axis, where the range is
    known.
    """
    known = None if radius_px is None else float(np.log(radius_px))
    values = np.array([*disk.centre_px, np.log(disk.radius_px), 0.0, 0.0])
    largest = 1 - min(target.radii_km) / max(target.radii_km)
    solved = None
    for reach_px, share in zip(REACH_PX, REACH_SHARE, strict=True):
        radius = float(np.exp(values[2]))
        reach = max(reach_px, share * radius) + (largest * radius if solved is None else 0.0)
        points = points_along(edges, values, min(reach, 0.45 * radius))
        if lit_from_deg is not None:
            away = points - values[:2]
            points = points[np.cos(np.arctan2(away[:, 1], away[:, 0]) - np.radians(lit_from_deg)) > LIT_COSINE]
        if len(points) < FEWEST_POINTS:
            return None
        solved = fitted(points, values, largest if largest * radius > ROUND_PX else 0.0, known)
        values = solved[0]
    if solved is None:
        return None
    values, covariance, residual, inliers = solved
    covered = arc_of(points[inliers] - values[:2])
    return Limb(values[:2], float(np.exp(values[2])), values[3:], covariance, points[inliers], covered, residual)


def radius_at(values: Array, angle: Array) -> Array:
    """Radius (n,) of the ellipse of `values` (5,) at position angles (n,) from its centre."""
    flat = float(np.hypot(values[3], values[4]))
    if flat == 0:
        return np.full(len(angle), np.exp(values[2]))
    from_axis = angle - 0.5 * np.arctan2(values[4], values[3])
    across = np.sin(from_axis) / (1 - min(flat, 0.9))
    return np.asarray(np.exp(values[2]) / np.sqrt(np.cos(from_axis) ** 2 + across**2))


def points_along(edges: Edges, values: Array, reach: float) -> Array:
    """Places (n, 2) where brightness falls fastest outward within `reach` pixels of the ellipse, the fall standing out
    of the noise and to a level that is dark beside that within."""
    import cv2

    count = int(np.clip(2 * np.pi * np.exp(values[2]), 48, MOST_POINTS))
    angle = np.linspace(-np.pi, np.pi, count, endpoint=False)
    offsets = np.arange(-reach, reach + STEP_PX / 2, STEP_PX)
    radius = radius_at(values, angle)[:, None] + offsets
    x = values[0] + radius * np.cos(angle)[:, None]
    y = values[1] + radius * np.sin(angle)[:, None]
    ny, nx = edges.clean.shape
    smooth = cv2.GaussianBlur(edges.clean, (0, 0), SMOOTH_PX)
    seen = (x >= 1) & (y >= 1) & (x <= nx - 2) & (y <= ny - 2)
    known = values_at(edges.usable.astype(np.float32), x.ravel(), y.ravel()).reshape(x.shape) > 0.99
    profile = values_at(smooth, x.ravel(), y.ravel()).reshape(x.shape).astype(np.float64)
    beside = max(round(1.0 / STEP_PX), 1)
    fall = profile[:, : -2 * beside] - profile[:, 2 * beside :]
    best = np.argmax(fall, axis=1).clip(1, fall.shape[1] - 2)
    rows = np.arange(count)
    left, here, right = fall[rows, best - 1], fall[rows, best], fall[rows, best + 1]
    curvature = left - 2 * here + right
    peak = np.where(curvature < 0, 0.5 * (left - right) / np.minimum(curvature, -1e-12), 0.0).clip(-1, 1)
    step = max(FALL_SIGMAS * edges.noise, FALL_SHARE * edges.span)
    # A gap elsewhere on the profile is no fault of the edge: a mark on a small disk would else hide half of its limb.
    around = best[:, None] + np.arange(2 * beside + 1)
    good = (here > step) & (here >= left) & (here >= right) & np.take_along_axis(seen & known, around, 1).all(axis=1)
    outside = profile[rows, np.minimum(best + 3 * beside, profile.shape[1] - 1)] - edges.dark
    inside = profile[rows, np.maximum(best - beside, 0)] - edges.dark
    good &= outside < 0.7 * inside
    away = radius[rows, best + beside] + peak * STEP_PX
    centre = values[:2]
    return np.asarray((centre + away[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1))[good])


def fitted(
    points: Array, start: Array, largest: float, known: float | None = None
) -> tuple[Array, Array, float, NDArray[np.bool_]]:
    """Robust ellipse (5,) through points (n, 2), its covariance (3, 3) of centre and logarithm of the half axis, the
    scatter, and which points lie within three times of it. largest: of the flattening; 0 holds a circle. known:
    logarithm of the half axis, by a known range."""
    from scipy.optimize import least_squares

    solve = 5 if largest > 0 else 3
    weak = largest / 2 if largest > 0 else 1.0

    def misses(values: Array) -> Array:
        full = np.concatenate([values, np.zeros(5 - len(values))])
        away = points - full[:2]
        miss = np.hypot(*away.T) - radius_at(full, np.arctan2(away[:, 1], away[:, 0]))
        if known is not None:
            miss = np.append(miss, 0.3 * np.sqrt(TOGETHER) * (values[2] - known) / KNOWN_SIGMA)
        if len(values) == 3:
            return np.asarray(miss)
        # The flattening is between none and the body's own; a short arc leaves it in the middle.
        beyond = max(float(np.hypot(*values[3:])) - largest, 0.0)
        return np.concatenate([miss, [0.3 * np.sqrt(TOGETHER) * beyond / (0.05 * largest)], 0.3 * values[3:] / weak])

    values, scale = start[:solve].copy(), 1.0
    for _ in range(3):
        values = least_squares(misses, values, loss="soft_l1", f_scale=max(scale, 0.1), x_scale="jac").x
        miss = misses(values)[: len(points)]
        scale = sigma_about_zero(miss)
    inliers = np.abs(miss) < 3 * max(scale, 0.15)
    design = least_squares(lambda v: misses(v), values, max_nfev=1).jac
    design = design[np.concatenate([inliers, np.ones(len(design) - len(points), bool)])]
    normal = design.T @ design
    errors = np.linalg.pinv(normal) * TOGETHER * max(scale, 0.1) ** 2
    # The shorter the arc, the more such an error of its ends moves the centre.
    centre_px = CENTRE_PX * float(np.sqrt(360 / max(arc_of(points[inliers] - values[:2]), 5.0)))
    full = np.concatenate([values, np.zeros(5 - len(values))])
    if np.hypot(*full[3:]) > largest > 0:
        full[3:] *= largest / np.hypot(*full[3:])
    mean_px = float(np.exp(values[2]) * np.sqrt(1 - np.hypot(*full[3:])))
    covariance = errors[:3, :3] + np.diag([centre_px, centre_px, RADIUS_PX / mean_px]) ** 2
    return full, covariance, scale, inliers


def arc_of(away: Array) -> float:
    """How many degrees of a circle points (n, 2) about its centre cover, by bins of 5 degrees."""
    angle = (np.degrees(np.arctan2(away[:, 1], away[:, 0])) % 360 / 5).astype(int)
    return 5.0 * len(np.unique(angle))
