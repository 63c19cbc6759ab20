"""A smooth surface through scattered values: thin-plate spline on a polynomial trend, with its own error estimates."""

from copy import copy
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catalog.errors import RefusedError
from catalog.reasons import Reason
from tasks.undistort.polynomial_basis import legendre_matrix, terms_of_degree

UNIT_PX = 80.0  # spacing of the marks; sets what `smoothing` means
SMOOTHING = 0.2
SIGMA_UNIT_PX = 0.1
BLOCK_POINTS = 20_000

Array = NDArray[np.float64]


class SmoothSurface:
    """Thin-plate spline plus polynomial trend, least squares weighted by sigma (universal kriging with the generalised
    covariance r^2 log r; Wahba 1990, Spline Models for Observational Data, chapter 2).

    Everything is linear in the values, so leave-one-out errors come in closed form: e_i = w_i / (M^-1)_ii, and
    `standardised`, the same in units of what was to be expected at each place but for one common scale.
    """

    def __init__(
        self,
        points: Array,
        values: Array,
        sigma: Array,
        size_px: tuple[int, int],
        degree: int,
        smoothing: float = SMOOTHING,
        assessed: NDArray[np.bool_] | None = None,
    ) -> None:
        """points (n, 2), values (n, k), sigma (n,): 1-sigma of the values; one of sigma `SIGMA_UNIT_PX` is smoothed by
        `smoothing`. assessed (n,): the points whose leave-one-out errors set the uncertainty's scale (default all).

        Raises RefusedError when there are not more points than the trend has terms.
        """
        terms = terms_of_degree(degree)
        if len(points) <= terms:
            raise RefusedError(
                Reason.DEGREE_TOO_HIGH,
                f"{len(points)} marks cannot carry a trend of degree {degree} ({terms} terms).",
                "Lower the degree or use more marks.",
            )
        self._points, self._size_px, self._degree = points, size_px, degree
        trend = legendre_matrix(points, degree, size_px)
        nugget = smoothing * (sigma / SIGMA_UNIT_PX) ** 2
        self._system = np.block([[_spline(points, points) + np.diag(nugget), trend], [trend.T, np.zeros((terms,) * 2)]])
        self._inverse: Array = np.linalg.inv(self._system)
        self._nugget = nugget
        self._fit(values, assessed)

    def through(self, values: Array, assessed: NDArray[np.bool_] | None = None) -> "SmoothSurface":
        """Other values (n, k) at the same points, of the same sigmas: the solved system is shared."""
        other = copy(self)
        other._fit(values, assessed)
        return other

    def _fit(self, values: Array, assessed: NDArray[np.bool_] | None) -> None:
        count = len(self._points)
        self._weights = self._inverse[:, :count] @ values
        diagonal = np.diag(self._inverse)[:count]
        self.leave_one_out: Array = self._weights[:count] / diagonal[:, None]
        self.residual: Array = self._weights[:count] * self._nugget[:, None]
        self.standardised: Array = self.leave_one_out * np.sqrt(np.abs(diagonal))[:, None]
        chosen = np.ones(count, dtype=bool) if assessed is None else assessed
        self._variance_scale = float((self.standardised[chosen] ** 2).mean())

    @cached_property
    def condition_number(self) -> float:
        """Of the symmetric system that gives spline and trend."""
        from scipy.sparse.linalg import eigsh

        # Only the largest eigenvalues are needed, of the system and of its inverse: a tenth of the time of all.
        first = np.ones(len(self._system))
        sizes = (eigsh(each, 1, v0=first, return_eigenvectors=False) for each in (self._system, self._inverse))
        return float(np.prod([abs(size[0]) for size in sizes]))

    def __call__(self, points: ArrayLike) -> Array:
        """Values (n, k) at points (n, 2)."""
        return np.concatenate([self._basis(block) @ self._weights for block in _blocks(points)])

    def sigma_at(self, points: ArrayLike) -> Array:
        """Expected 1-sigma error (n,) of one value at points (n, 2), on the scale of the leave-one-out errors."""
        variance = []
        for block in _blocks(points):
            basis = self._basis(block)
            variance.append(-np.einsum("ij,jk,ik->i", basis, self._inverse, basis, optimize=True))
        return np.sqrt(np.maximum(np.concatenate(variance), 0.0) * self._variance_scale)

    def _basis(self, points: Array) -> Array:
        return np.hstack([_spline(points, self._points), legendre_matrix(points, self._degree, self._size_px)])


def _spline(a: Array, b: Array) -> Array:
    from scipy.spatial.distance import cdist

    squared = cdist(a, b, "sqeuclidean") / UNIT_PX**2
    return 0.5 * squared * np.log(np.maximum(squared, 1e-300))


def _blocks(points: ArrayLike) -> list[Array]:
    array = np.asarray(points, dtype=np.float64)
    return np.array_split(array, max(1, -(-len(array) // BLOCK_POINTS)))
