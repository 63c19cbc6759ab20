"""From errors at scattered marks to an expected error everywhere."""

import numpy as np
from numpy.typing import NDArray

from tasks.undistort.mark_set import FitReport

BANDWIDTH_PX = 100.0  # about the spacing of the marks in object space
PRIOR_MARKS = 1.0
BLOCK_POINTS = 50_000


class ErrorMap:
    """Local root mean square of errors known at marks: squares averaged with Gaussian weights, and with one mark's
    weight of the global mean, which rules far from all marks."""

    def __init__(self, place: NDArray[np.float64], squares: NDArray[np.float64]) -> None:
        """place (n, 2): undistorted pixels. squares (n,): squared error of one coordinate there."""
        self._place, self._squares = place, squares
        self._mean = float(squares.mean())

    def __call__(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Expected 1-sigma error (n,) of one coordinate at undistorted pixels (n, 2)."""
        blocks = np.array_split(points, max(1, -(-len(points) // BLOCK_POINTS)))
        return np.sqrt(np.concatenate([self._local(block) for block in blocks]))

    def _local(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        from scipy.spatial.distance import cdist

        weight = np.exp(-0.5 * cdist(points, self._place, "sqeuclidean") / BANDWIDTH_PX**2)
        local = weight @ self._squares + PRIOR_MARKS * self._mean
        return np.asarray(local / (weight.sum(axis=1) + PRIOR_MARKS))


def error_map_of(report: FitReport) -> ErrorMap:
    """Expected error everywhere from the leave-one-out errors at the marks."""
    return ErrorMap(report.place, (report.leave_one_out**2).mean(axis=1))
