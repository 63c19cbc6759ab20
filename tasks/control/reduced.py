"""The normal equations of a bundle with its points eliminated (Schur complement)."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
DENSE = 8000  # unknowns of poses up to which the reduced system is factorised as a dense matrix
LEAST_POINT_INFORMATION = 1e-9  # km^-2: of points that no measure holds


@dataclass(frozen=True)
class Shared:
    """g unknowns that images have in common: by_shared (n, 2, g): derivatives of whitened pixels; information (g,),
    moves (g,): of their priors, and where they stand."""

    by_shared: Array
    information: Array
    moves: Array


class ReducedSystem:
    """by_pose (n, 2, p), by_point (n, 2, d): derivatives of whitened pixels; residual (n, 2); image, point (n,): which.
    information (images, p, p), moves (images, p): of the poses' priors, and where they stand; point_information (d,),
    heights (m, d): the same of every point. shared: of unknowns that images have in common."""

    def __init__(
        self,
        by_pose: Array,
        by_point: Array,
        residual: Array,
        image: NDArray[np.intp],
        point: NDArray[np.intp],
        information: Array,
        moves: Array,
        point_information: Array,
        heights: Array,
        shared: Shared | None = None,
    ) -> None:
        from scipy.sparse import bsr_matrix, coo_matrix

        self.images, self.points = len(information), len(heights)
        self.p, self.d = by_pose.shape[2], by_point.shape[2]
        own = information.copy()
        np.add.at(own, image, np.einsum("nki,nkj->nij", by_pose, by_pose))
        of_points = np.zeros((self.points, self.d, self.d))
        np.add.at(of_points, point, np.einsum("nki,nkj->nij", by_point, by_point))
        of_points += np.diag(point_information + LEAST_POINT_INFORMATION)
        self.point_inverse: Array = np.asarray(np.linalg.inv(of_points), np.float64)
        self.right = -np.einsum("kij,kj->ki", information, moves)
        np.add.at(self.right, image, np.einsum("nki,nk->ni", by_pose, residual))
        self.point_right = -point_information * heights
        np.add.at(self.point_right, point, np.einsum("nki,nk->ni", by_point, residual))
        mixed = np.einsum("nki,nkj->nij", by_pose, by_point)
        rows = image[:, None, None] * self.p + np.arange(self.p)[None, :, None]
        columns = point[:, None, None] * self.d + np.arange(self.d)[None, None, :]
        rows, columns = (np.broadcast_to(part, mixed.shape).ravel() for part in (rows, columns))
        shape = (self.images * self.p, self.points * self.d)
        self.mixed = coo_matrix((mixed.ravel(), (rows, columns)), shape=shape).tocsr()
        self.inverse_blocks = _diagonal(bsr_matrix, self.point_inverse)
        self.eliminated = self.mixed @ self.inverse_blocks
        self.matrix = _diagonal(bsr_matrix, own) - self.eliminated @ self.mixed.T
        if shared is None:
            shared = Shared(np.zeros((*residual.shape, 0)), np.zeros(0), np.zeros(0))
        self._border(shared, by_pose, by_point, residual, image, point)

    def _border(
        self,
        shared: Shared,
        by_pose: Array,
        by_point: Array,
        residual: Array,
        image: NDArray[np.intp],
        point: NDArray[np.intp],
    ) -> None:
        """What the shared unknowns have to do with poses and points (rows of the border, g columns), and their own
        part, the points and then the poses eliminated."""
        g = len(shared.moves)
        of_poses, of_points = np.zeros((self.images, self.p, g)), np.zeros((self.points, self.d, g))
        np.add.at(of_poses, image, np.einsum("nki,nkj->nij", by_pose, shared.by_shared))
        np.add.at(of_points, point, np.einsum("nki,nkj->nij", by_point, shared.by_shared))
        self.point_border = of_points.reshape(self.points * self.d, g)
        border = of_poses.reshape(self.images * self.p, g) - self.eliminated @ self.point_border
        eliminated = self.inverse_blocks @ self.point_border
        own = np.einsum("nki,nkj->ij", shared.by_shared, shared.by_shared) + np.diag(shared.information)
        right = np.einsum("nki,nk->i", shared.by_shared, residual) - shared.information * shared.moves
        self.pose_border: Array = np.asarray(self._factor(border) if g else border)
        self.shared_covariance: Array = np.asarray(
            np.linalg.inv(own - self.point_border.T @ eliminated - border.T @ self.pose_border), np.float64
        )
        self.shared_right: Array = right - eliminated.T @ self.point_right.ravel()

    @cached_property
    def _factor(self) -> Any:
        """Something that solves for a right side (images * p,) or (images * p, k)."""
        if self.images * self.p <= DENSE:
            from scipy.linalg import cho_solve

            factor, scale = self._dense_factor
            return lambda b: (scale * cho_solve((factor, True), (scale * b.T).T).T).T
        from scipy.sparse.linalg import splu

        return splu(self.matrix.tocsc()).solve

    def solve(self) -> tuple[Array, Array, Array]:
        """Steps of the poses (images, p), of the points (m, d) and of the shared unknowns (g,)."""
        point_right = self.point_right.ravel()
        right = self.right.ravel() - self.eliminated @ point_right
        step = self._factor(right)
        common = self.shared_covariance @ (self.shared_right - self.pose_border.T @ right)
        step = step - self.pose_border @ common
        of_points = self.inverse_blocks @ (point_right - self.mixed.T @ step - self.point_border @ common)
        return step.reshape(self.images, self.p), of_points.reshape(self.points, self.d), common

    def rough_sigmas(self) -> Array:
        """1-sigma of each pose's unknowns if all others were known (images, p)."""
        diagonal = np.asarray(self.matrix.diagonal()).reshape(self.images, self.p)
        return np.asarray(1 / np.sqrt(np.maximum(diagonal, 1e-300)))

    @cached_property
    def _columns(self) -> Array:
        """Inverse of the reduced system (images * p, images * p)."""
        if self.images * self.p > DENSE:
            return np.asarray(self._factor(np.eye(self.images * self.p)))
        from scipy.linalg.lapack import dpotri

        factor, scale = self._dense_factor
        inverse, _ = dpotri(factor, lower=True)
        upper = np.tril(inverse, -1).T
        return np.asarray((np.tril(inverse) + upper) * scale[:, None] * scale[None, :])

    @cached_property
    def _dense_factor(self) -> tuple[Array, Array]:
        """Lower Cholesky factor of the scaled reduced system, and the scale of its unknowns."""
        from scipy.linalg import cholesky

        dense = self.matrix.toarray()
        scale = 1 / np.sqrt(np.diag(dense))
        scaled = dense * scale[:, None] * scale[None, :]
        return cholesky(scaled, lower=True, check_finite=False), scale

    def pose_covariances(self) -> Array:
        """Of each pose (images, p, p)."""
        whole = self._columns.reshape(self.images, self.p, self.images, self.p)
        own = np.stack([whole[k, :, k, :] for k in range(self.images)])
        border = self.pose_border.reshape(self.images, self.p, len(self.shared_covariance))
        return np.asarray(own + border @ self.shared_covariance @ border.transpose(0, 2, 1))

    def point_sigmas(self) -> Array:
        """1-sigma (m, d) of the points: by their own measures, and by the poses'."""
        lever = self.eliminated.T.tocsr()  # (m * d, images * p)
        variance = np.einsum("mii->mi", self.point_inverse).ravel().copy()
        for row in range(lever.shape[0]):
            part = slice(lever.indptr[row], lever.indptr[row + 1])
            of, value = lever.indices[part], lever.data[part]
            variance[row] += value @ self._columns[np.ix_(of, of)] @ value
        common = self.inverse_blocks @ self.point_border - lever @ self.pose_border
        variance += np.einsum("ij,jk,ik->i", common, self.shared_covariance, common)
        return np.sqrt(variance).reshape(self.points, self.d)


def _diagonal(kind: Any, blocks: Array) -> Any:
    """Block-diagonal sparse matrix of blocks (k, b, b)."""
    count, size = blocks.shape[:2]
    made = kind((blocks, np.arange(count), np.arange(count + 1)), shape=(count * size, count * size))
    return made.tocsr()
