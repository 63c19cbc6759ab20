"""Two patches of the same ground: how far one lies from the other, and how well that is known."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
ROUNDS = 12
STILL = 0.005  # pixels of the patch
# Pixels of a patch that are independent of each other: it is sampled about as finely as the image, whose PSF and
# resampling smear 0.9 pixels (1-sigma) together: 4 pi 0.9^2 / (what a pixel is) of them have one error.
CORRELATED = 3.0


@dataclass(frozen=True)
class Matches:
    """k matches. shift (k, 2): where the second patch's content lies from the first's, in pixels to the right and down;
    covariance (k, 2, 2); correlation (k,); good (k,): whether the iteration came to rest within the search."""

    shift: Array
    covariance: Array
    correlation: Array
    good: NDArray[np.bool_]


def match_patches(first: Array, second: Array, margin: int) -> Matches:
    """Match patches `first` (k, n, n) within `second` (k, n + 2 margin, n + 2 margin), of positive brightness: the best
    of whole pixels by normalised correlation, then Gauss-Newton for shift, gain and level (Lucas and Kanade 1981).

    Logarithms are compared, less a plane each: what illumination leaves after normalisation would draw the match."""
    first, second = (_without_plane(np.log(np.maximum(part, 1e-9))) for part in (first, second))
    shift = _whole_pixels(first, second, margin)
    k, n = first.shape[:2]
    planes = _plane_basis(n)
    design = _design(first, planes)
    normal = np.einsum("kpi,kpj->kij", design, design)
    inverse = np.linalg.pinv(normal, hermitian=True)
    target = first.reshape(k, -1)
    steps = np.full((k, 2), np.inf)
    for _ in range(ROUNDS):
        moving = np.abs(steps).max(axis=1) > STILL
        if not moving.any():
            break
        found = _shifted(second[moving], shift[moving], n, margin).reshape(moving.sum(), -1)
        right = np.einsum("kpi,kp->ki", design[moving], _levelled(found, target[moving], planes) - target[moving])
        steps[moving] = np.clip(np.einsum("kij,kj->ki", inverse[moving], right)[:, :2], -1, 1)
        shift[moving] = np.clip(shift[moving] + steps[moving], -margin, margin)
    found = _levelled(_shifted(second, shift, n, margin).reshape(k, -1), target, planes)
    residual = found - target
    variance = (residual**2).sum(axis=1) / (n * n - 6) * CORRELATED
    spread = target.std(axis=1)
    correlation = _correlation(found, target)
    good = (np.abs(steps).max(axis=1) <= 0.05) & (np.abs(shift).max(axis=1) < margin - 0.5) & (spread > 0)
    return Matches(shift, inverse[:, :2, :2] * variance[:, None, None], correlation, good)


def _whole_pixels(first: Array, second: Array, margin: int) -> Array:
    import cv2

    shift = np.empty((len(first), 2))
    for k, (a, b) in enumerate(zip(first, second, strict=True)):
        scores = cv2.matchTemplate(b.astype(np.float32), a.astype(np.float32), cv2.TM_CCOEFF_NORMED)
        row, column = np.unravel_index(int(np.argmax(scores)), scores.shape)
        shift[k] = column - margin, row - margin
    return shift


def _plane_basis(n: int) -> Array:
    """Orthonormal level and slopes (n n, 3) of a patch."""
    row, column = (part.ravel() for part in np.indices((n, n)) - (n - 1) / 2)
    basis = np.stack([np.ones(n * n), row, column], axis=1)
    return np.asarray(basis / np.linalg.norm(basis, axis=0))


def _without_plane(patches: Array) -> Array:
    basis = _plane_basis(patches.shape[1])
    flat = patches.reshape(len(patches), -1)
    return np.asarray((flat - (flat @ basis) @ basis.T).reshape(patches.shape))


def _design(first: Array, planes: Array) -> Array:
    """Derivatives (k, n n, 6) of a patch that is sampled further right and down: shift, gain, level, slopes."""
    rows, columns = np.gradient(first, axis=(1, 2))
    parts = [part.reshape(len(first), -1)[..., None] for part in (-columns, -rows, first)]
    return np.concatenate([*parts, np.broadcast_to(planes, (len(first), *planes.shape))], axis=-1)


def _levelled(found: Array, target: Array, planes: Array) -> Array:
    """`found` (k, p) less its plane, with the spread of `target`, which has none."""
    found = found - (found @ planes) @ planes.T
    spread = np.maximum(found.std(axis=1, keepdims=True), 1e-12)
    correlation = np.maximum(_correlation(found, target)[:, None], 0.1)
    gain = target.std(axis=1, keepdims=True) * correlation / spread
    return np.asarray((found - found.mean(axis=1, keepdims=True)) * gain + target.mean(axis=1, keepdims=True))


def _correlation(a: Array, b: Array) -> Array:
    a, b = a - a.mean(axis=1, keepdims=True), b - b.mean(axis=1, keepdims=True)
    size = np.sqrt((a**2).sum(axis=1) * (b**2).sum(axis=1))
    return np.asarray((a * b).sum(axis=1) / np.maximum(size, 1e-300))


def _shifted(second: Array, shift: Array, n: int, margin: int) -> Array:
    """Parts (k, n, n) of `second`, `shift` further right and down than its middle, by bicubic interpolation."""
    import cv2

    k = len(second)
    grid = np.arange(n) + margin
    found = np.empty((k, n, n))
    for number in range(k):
        x = (grid + shift[number, 0]).astype(np.float32)
        y = (grid + shift[number, 1]).astype(np.float32)
        columns, rows = np.meshgrid(x, y)
        found[number] = cv2.remap(
            second[number].astype(np.float32), columns, rows, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE
        )
    return found
