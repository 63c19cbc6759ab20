"""Where the light comes from: the Sun's direction by terminator and shading of a disk whose limb is known."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tasks.compiled import compiled, compiled_reordered
from tasks.initial_pose.edges import Edges, values_at
from tasks.initial_pose.limb import Limb, radius_at

Array = NDArray[np.float64]

# Shading is smooth: samples across the disk, and how far the sky around it is looked at, radii.
ACROSS, REACH = 36, 1.4
# Places so near to the limb are mixed with sky, radii; samples outside the disk are sky beyond this.
RIM = 0.03
PHASES_DEG, AZIMUTHS_DEG = np.arange(5.0, 176.0, 10.0), np.arange(0.0, 360.0, 15.0)
ROUNDS = 7
LAWS = 4
# Of the mean square of a law: what keeps two laws that look alike apart.
RIDGE = 1e-9
# How many parts of a disk err on their own, by markings and laws.
INDEPENDENT = 60.0
# Less of a disk in the frame shows no shading.
LEAST_SHARE = 0.01
# Largest 1-sigma, where nothing tells.
UNKNOWN_DEG = 60.0


@dataclass(frozen=True)
class SunInDisk:
    """azimuth_deg: where the light comes from in the image, from +x towards +y; phase_deg: phase angle; their 1-sigma,
    by what markings and laws leave. likeness: correlation of image and shaded disk, sky around it included. disk_share:
    part of the disk that is in the frame."""

    azimuth_deg: float
    phase_deg: float
    azimuth_sigma_deg: float
    phase_sigma_deg: float
    likeness: float
    disk_share: float


def sun_of_disk(edges: Edges, limb: Limb) -> SunInDisk | None:
    """The direction of the light with which a sphere of a mixture of photometric laws of positive weights looks most
    like the image; None where too little of disk and sky is in the frame."""
    samples = Samples.of(edges, limb)
    if samples is None:
        return None
    grid = [(a, p) for p in PHASES_DEG for a in AZIMUTHS_DEG]
    left = np.array([samples.left_over(a, p) for a, p in grid])
    azimuth, phase = grid[int(np.argmin(left))]
    least, step = float(left.min()), 5.0
    for _ in range(ROUNDS):
        wide = max(float(np.sin(np.radians(phase))), 0.1)
        moves = [(azimuth + i * step / wide, phase + j * step) for i in (-1, 0, 1) for j in (-1, 0, 1)]
        moves = [(a, p) for a, p in moves if 0.5 <= p <= 179.5]
        tried = [samples.left_over(*move) for move in moves]
        if min(tried) < least:
            least, (azimuth, phase) = min(tried), moves[int(np.argmin(tried))]
        else:
            step /= 2
    total = samples.total
    sigma = [samples.sigma(azimuth, phase, least, axis) for axis in (0, 1)]
    likeness = float(np.sqrt(max(1 - least / total, 0.0))) if total > 0 else 0.0
    return SunInDisk(azimuth % 360, float(phase), sigma[0], sigma[1], likeness, samples.disk_share)


@dataclass(frozen=True)
class Samples:
    """u, v: (n,) places in radii from the centre, w: (n,) cosine of emission, 0 outside the disk; value: (n,)
    brightness less its mean."""

    u: Array
    v: Array
    w: Array
    value: Array

    @classmethod
    def of(cls, edges: Edges, limb: Limb) -> "Samples | None":
        """Of the disk and the sky around it, as far as they are in the frame; None where that is too little."""
        import cv2

        line = (np.arange(-int(REACH * ACROSS / 2), int(REACH * ACROSS / 2) + 1)) * 2 / ACROSS
        u, v = (each.ravel() for each in np.meshgrid(line, line))
        values = np.array([*limb.centre_px, np.log(limb.semi_px), *limb.flattening])
        radius = radius_at(values, np.arctan2(v, u))
        x, y = limb.centre_px[0] + u * radius, limb.centre_px[1] + v * radius
        ny, nx = edges.clean.shape
        width = limb.semi_px * 2 / ACROSS
        smooth = cv2.GaussianBlur(edges.clean, (0, 0), max(0.3 * width, 0.5))
        distance = np.hypot(u, v)
        chosen = (x >= 0) & (y >= 0) & (x <= nx - 1) & (y <= ny - 1) & (np.abs(distance - 1) > RIM) & (distance < REACH)
        chosen &= values_at(edges.usable.astype(np.float32), x, y) > 0.5
        inside = chosen & (distance < 1)
        if inside.sum() < LEAST_SHARE * np.pi * (ACROSS / 2) ** 2 or (chosen & (distance > 1)).sum() < 20:
            return None
        u, v, distance = u[chosen], v[chosen], distance[chosen]
        seen = values_at(smooth, x[chosen], y[chosen]).astype(np.float64)
        # A few bright dots outside would else be the disk.
        sky = seen[distance > 1]
        seen[distance > 1] = np.minimum(sky, np.percentile(sky, 98))
        w = np.where(distance < 1, np.sqrt(np.maximum(1 - distance**2, 0)), 0)
        return cls(u, v, w, seen - seen.mean())

    @property
    def disk_share(self) -> float:
        """Part of the disk that the samples cover."""
        return min(float((self.w > 0).sum() / (np.pi * (ACROSS / 2) ** 2)), 1.0)

    @property
    def total(self) -> float:
        """Sum of squares of the brightness."""
        return float(self.value @ self.value)

    def left_over(self, azimuth_deg: float, phase_deg: float) -> float:
        """Sum of squares that the best mixture of laws of positive weights leaves, with the light from there."""
        azimuth, phase = np.radians([azimuth_deg, phase_deg])
        sun = (np.sin(phase) * np.cos(azimuth), np.sin(phase) * np.sin(azimuth), np.cos(phase))
        return self.total - float(explained_by_laws(self.u, self.v, self.w, self.value, sun))

    def sigma(self, azimuth_deg: float, phase_deg: float, least: float, axis: int) -> float:
        """1-sigma, degrees, of azimuth (axis 0) or phase (1): where what is left grows by as much as one of so many
        independent parts leaves."""
        for step in (0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0):
            moved = [(azimuth_deg + s * step * (axis == 0), phase_deg + s * step * (axis == 1)) for s in (-1, 1)]
            grown = max(self.left_over(a, min(max(p, 0.0), 180.0)) for a, p in moved) - least
            if grown > least / INDEPENDENT:
                return float(step * np.sqrt(least / INDEPENDENT / grown))
        return UNKNOWN_DEG


@compiled
def explained_by_laws(u: Array, v: Array, w: Array, value: Array, sun: tuple[float, float, float]) -> float:
    """By how much the best mixture of laws of positive weights lowers the sum of squares of `value`, whose mean is 0.

    Of few laws each subset is tried: the best mixture is the least-squares solution of the laws that it has.
    """
    normal, right = law_products(u, v, w, value, sun)
    ridge = RIDGE * np.trace(normal) + 1e-12
    most = 0.0
    weights, chosen = np.zeros(LAWS), np.zeros(LAWS, np.int64)
    rows = np.zeros((LAWS, LAWS + 1))
    for subset in range(1, 2**LAWS):
        count = 0
        for law in range(LAWS):
            if subset >> law & 1:
                chosen[count] = law
                count += 1
        for i in range(count):
            for j in range(count):
                rows[i, j] = normal[chosen[i], chosen[j]]
            rows[i, i] += ridge
            rows[i, count] = right[chosen[i]]
        # Elimination without exchange of rows: the matrix is symmetric and positive.
        for i in range(count):
            for k in range(i + 1, count):
                factor = rows[k, i] / rows[i, i]
                for j in range(i, count + 1):
                    rows[k, j] -= factor * rows[i, j]
        positive, explained = True, 0.0
        for i in range(count - 1, -1, -1):
            weights[i] = rows[i, count]
            for j in range(i + 1, count):
                weights[i] -= rows[i, j] * weights[j]
            weights[i] /= rows[i, i]
            positive = positive and weights[i] > 0
        for i in range(count):
            explained += 2 * weights[i] * right[chosen[i]]
            for j in range(count):
                explained -= weights[i] * normal[chosen[i], chosen[j]] * weights[j]
        if positive and explained > most:
            most = explained
    return most


@compiled_reordered
def law_products(u: Array, v: Array, w: Array, value: Array, sun: tuple[float, float, float]) -> tuple[Array, Array]:
    """Products (4, 4) of four laws over the samples, each less its mean, with each other, and with `value` (4,), whose
    mean is 0: Lambert's mu0, Lommel-Seeliger's 2 mu0 / (mu0 + mu), Minnaert's mu0 mu, and mu0 squared. sun: unit vector
    of the light along u, v and w."""
    sums, products, right = np.zeros(LAWS), np.zeros((LAWS, LAWS)), np.zeros(LAWS)
    laws = np.zeros(LAWS)
    for k in range(len(w)):
        mu0 = sun[0] * u[k] + sun[1] * v[k] + sun[2] * w[k]
        if w[k] > 0 and mu0 > 0:
            laws[0], laws[1], laws[2], laws[3] = mu0, 2 * mu0 / max(mu0 + w[k], 1e-6), mu0 * w[k], mu0 * mu0
            for i in range(LAWS):
                sums[i] += laws[i]
                right[i] += laws[i] * value[k]
                for j in range(i + 1):
                    products[i, j] += laws[i] * laws[j]
    for i in range(LAWS):
        for j in range(i + 1):
            products[i, j] -= sums[i] * sums[j] / len(w)
            products[j, i] = products[i, j]
    return products, right
