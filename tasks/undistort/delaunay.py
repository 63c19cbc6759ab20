"""Local affine maps on the Delaunay triangles between the marks (the paper's method 3), continued beyond their hull."""

from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catalog.errors import RefusedError
from catalog.reasons import Reason
from tasks.undistort.error_map import ErrorMap, error_map_of
from tasks.undistort.mark_set import FitReport, MarkSet
from tasks.undistort.model import Points
from tasks.undistort.polynomial_basis import legendre_matrix, terms_of_degree
from tasks.undistort.triangles import TriangleMap

RING_MARGIN_PX = 60.0
RING_POINTS_PER_SIDE = 12
RING_DEGREE = 3
RING_NEIGHBOURS = 3
FAR_FRAMES = 20.0


class DelaunayModel:
    """Paper's method 3 between the marks; beyond them triangles to a ring of guessed points around the frame.

    The ring's places come from a cubic polynomial through all marks, corrected by what it misses at the nearest marks:
    so the map stays continuous at the hull, one-to-one, and exactly invertible. Points that lean on the ring, or on a
    mark that was not found, are `extrapolated`. A second ring, 20 frames away, carries the best affine map, which also
    rules beyond it.
    """

    name = "delaunay"
    smooth = False

    def __init__(self, marks: MarkSet) -> None:
        """Raises RefusedError for fewer marks than a cubic needs, collinear marks, and marks out of order."""
        self.marks, self.raw_size_px, self.size_px = marks, marks.raw_size_px, marks.size_px
        used = ~marks.outside | marks.found
        raw, known = marks.raw_xy[used], marks.object_xy[used]
        if len(known) < terms_of_degree(RING_DEGREE):
            raise RefusedError(
                Reason.MARKS_TOO_FEW,
                f"{len(known)} reseau marks are too few for the Delaunay method.",
                f"It needs {terms_of_degree(RING_DEGREE)}; use the nominal table (marks = nominal).",
            )
        size_px = self.size_px
        near, far = _ring(size_px, RING_MARGIN_PX), _ring(size_px, FAR_FRAMES * max(size_px), points=1)
        self._affine = _fit(known, raw, 1, size_px)
        far_raw = legendre_matrix(far, 1, size_px) @ self._affine
        near_raw = _continued(known, raw, near, size_px)
        self._map = TriangleMap(np.vstack([known, near, far]), np.vstack([raw, near_raw, far_raw]))
        measured = np.concatenate([marks.found[used], np.zeros(len(near) + len(far), dtype=bool)])
        self._leans_on_guess: NDArray[np.bool_] = np.any(~measured[self._map.corners], axis=1)

    @cached_property
    def report(self) -> FitReport:
        """Residuals are zero by construction; leave-one-out by leaving each mark out of the triangulation in turn."""
        found = np.flatnonzero(self.marks.found)
        true = self.marks.object_xy[found]
        predicted = [DelaunayModel(self.marks.without(int(i))).undistort_points(self.marks.raw_xy[i]) for i in found]
        residual = self.undistort_points(self.marks.raw_xy[found]) - true
        return FitReport("delaunay", true, residual, np.array(predicted) - true, self._map.worst_condition_number)

    @cached_property
    def _errors(self) -> ErrorMap:
        return error_map_of(self.report)

    def distort_points(self, xy: ArrayLike) -> Points:
        """Raw places (..., 2) of undistorted pixels (..., 2)."""
        points = np.asarray(xy, dtype=np.float64)
        flat = points.reshape(-1, 2)
        triangle = self._map.triangle_of(flat)
        mapped = self._map.forward(flat, triangle)
        beyond = triangle < 0
        mapped[beyond] = legendre_matrix(flat[beyond], 1, self.size_px) @ self._affine
        return mapped.reshape(points.shape)

    def undistort_points(self, xy_raw: ArrayLike) -> Points:
        """Undistorted places (..., 2) of raw pixels (..., 2)."""
        points = np.asarray(xy_raw, dtype=np.float64)
        flat = points.reshape(-1, 2)
        triangle = self._map.triangle_of_target(flat)
        mapped = self._map.backward(flat, triangle)
        beyond = triangle < 0
        mapped[beyond] = self._affine_inverse(flat[beyond])
        return mapped.reshape(points.shape)

    def _affine_inverse(self, raw: Points) -> Points:
        corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
        origin, along_x, along_y = legendre_matrix(corners, 1, self.size_px) @ self._affine
        return (raw - origin) @ np.linalg.inv(np.stack([along_x - origin, along_y - origin]))

    def extrapolated(self, xy: ArrayLike) -> NDArray[np.bool_]:
        """True (...,) for undistorted pixels that lean on guessed or unseen marks."""
        points = np.asarray(xy, dtype=np.float64)
        triangle = self._map.triangle_of(points.reshape(-1, 2))
        return ((triangle < 0) | self._leans_on_guess[triangle]).reshape(points.shape[:-1])

    def uncertainty_px(self, xy: ArrayLike) -> NDArray[np.float64]:
        """Expected 1-sigma error (...,) of one coordinate at undistorted pixels (..., 2): the local leave-one-out
        error; inside the triangles an upper bound, for leaving out a mark makes them twice as wide."""
        points = np.asarray(xy, dtype=np.float64)
        return self._errors(points.reshape(-1, 2)).reshape(points.shape[:-1])


def _ring(size_px: tuple[int, int], margin_px: float, points: int = RING_POINTS_PER_SIDE) -> Points:
    right, bottom = size_px[0] - 1 + margin_px, size_px[1] - 1 + margin_px
    t = np.linspace(0.0, 1.0, points, endpoint=False)
    x, y = -margin_px + t * (right + margin_px), -margin_px + t * (bottom + margin_px)
    first, one = np.full(points, -margin_px), np.ones(points)
    sides = [(x, first), (right * one, y), (right - margin_px - x, bottom * one), (first, bottom - margin_px - y)]
    return np.concatenate([np.stack(side, axis=-1) for side in sides])


def _fit(known: Points, raw: Points, degree: int, size_px: tuple[int, int]) -> NDArray[np.float64]:
    return np.asarray(np.linalg.lstsq(legendre_matrix(known, degree, size_px), raw, rcond=None)[0], dtype=np.float64)


def _continued(known: Points, raw: Points, places: Points, size_px: tuple[int, int]) -> Points:
    """Raw places of `places` beyond the hull: polynomial trend plus what it misses at the nearest marks."""
    coefficients = _fit(known, raw, RING_DEGREE, size_px)
    missed: Points = raw - legendre_matrix(known, RING_DEGREE, size_px) @ coefficients
    distance = np.linalg.norm(places[:, None] - known[None], axis=2)
    nearest = np.argsort(distance, axis=1)[:, :RING_NEIGHBOURS]
    weight = 1.0 / np.take_along_axis(distance, nearest, axis=1) ** 2
    weight /= weight.sum(axis=1, keepdims=True)
    correction = np.einsum("ij,ijk->ik", weight, missed[nearest])
    continued: Points = legendre_matrix(places, RING_DEGREE, size_px) @ coefficients + correction
    return continued
