"""First guess of the reseau marks: dark spots of the right shape, and the smooth shift that explains most of them."""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from catalog.observation import Observation, Quality
from tasks.undistort.mark_fit import spot
from tasks.undistort.polynomial_basis import legendre_matrix

TEMPLATE_HALF_PX = 4
SPOT_LIKENESS = 0.55
SPOT_DEPTH = 0.3
SHIFT_RANGE_PX = 25
LARGEST_COPY_PX = 16
COPIED_FRACTION = 0.95
ROUNDS = ((0, 6.0), (1, 5.0), (2, 4.0), (3, 3.5))  # degree of the shift, search radius in px

Array = NDArray[np.float64]


def without_copied_edges(observation: Observation) -> Observation:
    """Observation whose outermost columns are MISSING where they only repeat the first good one (some decompressed
    Voyager frames start with four equal columns): a mark there would be drawn out to the edge."""
    quality = observation.quality.copy()
    for view, flags in ((observation.image, quality), (observation.image[:, ::-1], quality[:, ::-1])):
        flags[:, : _copied_columns(view)] |= np.uint16(Quality.MISSING)
    return dataclasses.replace(observation, quality=quality)


def _copied_columns(image: NDArray[np.float32]) -> int:
    """How many columns repeat the one behind them."""
    count = 0
    while count < LARGEST_COPY_PX and (image[:, count] == image[:, count + 1]).mean() > COPIED_FRACTION:
        count += 1
    return count if image[:, : count + 1].std() > 0 else 0


def dark_spots(observation: Observation) -> Array:
    """Whole-pixel places (m, 2) that look like a mark: correlation with the spot above `SPOT_LIKENESS`, and darker than
    their surroundings by at least `SPOT_DEPTH`."""
    import cv2
    from scipy.ndimage import maximum_filter

    image = np.nan_to_num(observation.image).astype(np.float32)
    half = TEMPLATE_HALF_PX
    dy, dx = np.mgrid[-half : half + 1, -half : half + 1].astype(np.float64)
    template = spot(dx, dy)[0].astype(np.float32)
    padded = cv2.copyMakeBorder(image, half, half, half, half, cv2.BORDER_REFLECT_101)
    likeness = -cv2.matchTemplate(padded, template, cv2.TM_CCOEFF_NORMED)
    centred = template - template.mean()
    depth = -cv2.filter2D(image, -1, centred / float((centred * template).sum()), borderType=cv2.BORDER_REFLECT_101)
    surroundings = cv2.blur(image, (13, 13), borderType=cv2.BORDER_REFLECT_101)
    peak = (likeness == maximum_filter(likeness, 5)) & (likeness > SPOT_LIKENESS)
    peak &= depth > SPOT_DEPTH * np.maximum(surroundings, observation.noise)
    rows, columns = np.nonzero(peak)
    return np.stack([columns, rows], axis=-1).astype(np.float64)


def first_guess(nominal_xy: Array, spots: Array, size_px: tuple[int, int]) -> tuple[Array, NDArray[np.bool_]]:
    """Places (n, 2) where to start the fit of each mark, and whether a dark spot is there (n,).

    A common shift is voted for by all pairs of marks and spots; then a polynomial shift of growing degree is fitted,
    robustly, to the nearest spots within a shrinking radius.
    """
    from scipy.spatial import cKDTree

    if len(spots) == 0:
        return nominal_xy.copy(), np.zeros(len(nominal_xy), dtype=bool)
    shift = np.broadcast_to(_voted_shift(nominal_xy, spots), nominal_xy.shape)
    tree = cKDTree(spots)
    for degree, radius_px in ROUNDS:
        distance, nearest = tree.query(nominal_xy + shift)
        near = distance < radius_px
        if near.sum() < 2 * legendre_matrix(nominal_xy[:1], degree, size_px).shape[1]:
            break
        shift = _robust_shift(nominal_xy, spots[nearest] - nominal_xy, near, degree, size_px)
    expected = nominal_xy + shift
    distance, nearest = tree.query(expected)
    near = distance < ROUNDS[-1][1]
    return np.where(near[:, None], spots[nearest], expected), near


def _voted_shift(nominal_xy: Array, spots: Array) -> Array:
    from scipy.ndimage import uniform_filter

    pairs = (spots[None] - nominal_xy[:, None]).reshape(-1, 2)
    edges = np.arange(-SHIFT_RANGE_PX - 0.5, SHIFT_RANGE_PX + 1)
    votes, *_ = np.histogram2d(pairs[:, 0], pairs[:, 1], bins=(edges, edges))
    best = np.unravel_index(np.argmax(uniform_filter(votes, 5)), votes.shape)
    return np.array(best, dtype=np.float64) - SHIFT_RANGE_PX


def _robust_shift(
    nominal_xy: Array, shift: Array, near: NDArray[np.bool_], degree: int, size_px: tuple[int, int]
) -> Array:
    terms = legendre_matrix(nominal_xy, degree, size_px)
    weight = near.astype(np.float64)
    fitted = shift
    for _ in range(6):
        root = np.sqrt(weight)[:, None]
        fitted = terms @ np.linalg.lstsq(terms * root, shift * root, rcond=None)[0]
        weight = near / np.maximum(1.0, np.linalg.norm(shift - fitted, axis=1))
    return fitted
