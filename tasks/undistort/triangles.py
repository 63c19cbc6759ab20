"""A piecewise affine map on triangles and its exact inverse."""

import numpy as np
from numpy.typing import NDArray

from catalog.errors import RefusedError
from catalog.reasons import Reason
from tasks.undistort.model import Points

CANDIDATE_TRIANGLES = 24
INSIDE_TOLERANCE = 1e-9
COLLINEAR_PX = 1.0


def refuse_collinear(points: Points) -> None:
    """Raise RefusedError when `points` (n, 2) lie on one line to within a pixel."""
    spread = points - points.mean(axis=0)
    if len(points) < 3 or np.linalg.svd(spread, compute_uv=False)[1] < np.sqrt(len(points)) * COLLINEAR_PX:
        raise RefusedError(
            Reason.MARKS_COLLINEAR,
            f"the {len(points)} marks lie on one line, so they span no area.",
            "Give marks that surround the area to be undistorted.",
        )


class TriangleMap:
    """Delaunay triangles over `source` (n, 2); each carries the affine map that takes its corners to those of `target`
    (n, 2) (the paper's equations 5-7). Continuous, and one-to-one as long as no triangle turns over.

    Raises RefusedError when the points are collinear or a triangle turns over.
    """

    def __init__(self, source: Points, target: Points) -> None:
        from scipy.spatial import Delaunay, cKDTree

        refuse_collinear(source)
        self._triangulation = Delaunay(source)
        self.corners: NDArray[np.int64] = self._triangulation.simplices.astype(np.int64)
        self.source, self.target = source, target
        self._check_orientation()
        self._forward = _affine(source[self.corners], target[self.corners])
        self._backward = _affine(target[self.corners], source[self.corners])
        self._centroids = cKDTree(target[self.corners].mean(axis=1))

    def _check_orientation(self) -> None:
        before, after = (_signed_area(points[self.corners]) for points in (self.source, self.target))
        turned = np.flatnonzero(before * after <= 0)
        if len(turned):
            place = self.source[self.corners[turned[0]]].mean(axis=0).round(1).tolist()
            raise RefusedError(
                Reason.MARKS_FOLDED,
                f"{len(turned)} triangles between marks turn over, the first near {place}: a mark is out of order.",
                "Check the marks there, or leave the wrong one out.",
            )

    @property
    def worst_condition_number(self) -> float:
        """Largest condition number of a triangle's edges: how much its flattest one amplifies errors."""
        triangles = self.source[self.corners]
        edges = triangles[:, 1:] - triangles[:, :1]
        return float(np.linalg.cond(edges).max())

    def triangle_of(self, points: Points) -> NDArray[np.int64]:
        """Number of the triangle that holds each source point (n, 2); -1 outside all."""
        return self._triangulation.find_simplex(points).astype(np.int64)

    def triangle_of_target(self, points: Points) -> NDArray[np.int64]:
        """Number of the mapped triangle that holds each target point (n, 2); -1 outside all."""
        found = np.full(len(points), -1, dtype=np.int64)
        finite = np.flatnonzero(np.isfinite(points).all(axis=1))
        count = min(CANDIDATE_TRIANGLES, len(self.corners))
        _, nearest = self._centroids.query(points[finite], k=count)
        self._search(points, found, finite, nearest.reshape(len(finite), count))
        lost = finite[found[finite] < 0]
        everything = np.broadcast_to(np.arange(len(self.corners)), (len(lost), len(self.corners)))
        self._search(points, found, lost, everything)
        return found

    def _search(self, points: Points, found: NDArray, rows: NDArray, candidates: NDArray) -> None:
        for column in range(candidates.shape[1]):
            open_rows = found[rows] < 0
            if not open_rows.any():
                return
            at, triangle = rows[open_rows], candidates[open_rows, column]
            inside = _barycentric(points[at], self.target[self.corners[triangle]]).min(axis=1) >= -INSIDE_TOLERANCE
            found[at[inside]] = triangle[inside]

    def forward(self, points: Points, triangle: NDArray[np.int64]) -> Points:
        """Target places (n, 2) of source points, each by the map of its triangle; NaN where that is -1."""
        return _apply(self._forward, points, triangle)

    def backward(self, points: Points, triangle: NDArray[np.int64]) -> Points:
        """Source places (n, 2) of target points, each by the inverse map of its triangle; NaN where that is -1."""
        return _apply(self._backward, points, triangle)


def _signed_area(triangles: NDArray[np.float64]) -> NDArray[np.float64]:
    a, b = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    return 0.5 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def _affine(source: NDArray[np.float64], target: NDArray[np.float64]) -> NDArray[np.float64]:
    edges_in = np.swapaxes(source[:, 1:] - source[:, :1], 1, 2)
    edges_out = np.swapaxes(target[:, 1:] - target[:, :1], 1, 2)
    matrix = edges_out @ np.linalg.inv(edges_in)
    shift = target[:, 0] - np.einsum("nij,nj->ni", matrix, source[:, 0])
    return np.concatenate([matrix, shift[:, :, None]], axis=2)


def _apply(maps: NDArray[np.float64], points: Points, triangle: NDArray[np.int64]) -> Points:
    chosen = maps[triangle]
    mapped = np.einsum("nij,nj->ni", chosen[:, :, :2], points) + chosen[:, :, 2]
    mapped[triangle < 0] = np.nan
    return mapped


def _barycentric(points: Points, triangles: NDArray[np.float64]) -> NDArray[np.float64]:
    a, b, p = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0], points - triangles[:, 0]
    area = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    u = (p[:, 0] * b[:, 1] - p[:, 1] * b[:, 0]) / area
    v = (a[:, 0] * p[:, 1] - a[:, 1] * p[:, 0]) / area
    return np.stack([1.0 - u - v, u, v], axis=1)
