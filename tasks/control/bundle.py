"""Bundle adjustment: all poses and all points on the ground together, by Gauss-Newton with the points eliminated.

Triggs et al. 2000, Bundle Adjustment - A Modern Synthesis, LNCS 1883, 298: reduced camera system, robust weights.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera
from catalog.pose import Pose
from catalog.robust import huber_weight, sigma_about_zero
from catalog.target import Target
from tasks.control.camera_constants import CameraConstants, constants_of
from tasks.control.patches import Places, places_at
from tasks.control.reduced import ReducedSystem, Shared
from tasks.control.settings import ControlSettings
from tasks.control.ties import Ties
from tasks.joint.parameters import NAMES, State
from tasks.mosaic.view import place_derivatives
from tasks.project.points import pixels_of_points
from tasks.project.uncertainty import PARAMETERS

Array = NDArray[np.float64]
UNKNOWNS = len(PARAMETERS)
HUBER = 2.0
ROUNDS = 12  # the problem is nearly linear: steps only follow the weights
SETTLED = 0.02  # of a sigma
STEP_KM = 0.05
LEAST_SCALE = 0.5


@dataclass(frozen=True)
class Bundle:
    """poses: adjusted; moves (images, 7): what was added to each pose's unknowns, in the units of
    `tasks.project.uncertainty.PARAMETERS`; covariance (images, 7, 7): of each. points (m, 3) km, point_sigma_km (m,
    dims): 1-sigma east, north (and up). residual_px (n, 2): measured minus computed; used (n,): measures that were
    kept. redundancy (images,): how far an image's measures check each other, from 0 to 1. sigma_scale: by how much
    measures scatter more than they state, part of the covariances. constants: of the cameras; constants_covariance
    (unknowns, unknowns): of those that were solved."""

    poses: tuple[Pose, ...]
    moves: Array
    covariance: Array
    points: Array
    point_sigma_km: Array
    residual_px: Array
    used: NDArray[np.bool_]
    redundancy: Array
    sigma_scale: float
    rounds: int
    constants: CameraConstants
    constants_covariance: Array


def adjust_bundle(
    poses: Sequence[Pose],
    cameras: Sequence[Camera],
    target: Target,
    ties: Ties,
    priors: Array,
    settings: ControlSettings,
) -> Bundle:
    """Adjust poses, points and the cameras' constants (`settings.solve`) to the ties. priors (images, 7, 7): covariance
    of each pose's unknowns.

    Measures count by their covariances, robustly; those further off than `reject_sigma` are left out, and come back
    when a later solution agrees with them."""
    return _Problem(poses, cameras, target, ties, priors, settings).solve()


class _Problem:
    """Unknowns: moves (images, 7) of the poses, places of the points."""

    def __init__(
        self,
        poses: Sequence[Pose],
        cameras: Sequence[Camera],
        target: Target,
        ties: Ties,
        priors: Array,
        settings: ControlSettings,
    ) -> None:
        self.start, self.cameras, self.target, self.ties, self.settings = poses, cameras, target, ties, settings
        self.information: Array = np.asarray(np.linalg.inv(priors), np.float64)
        self.of_image = [np.flatnonzero(ties.image == k) for k in range(len(poses))]
        self.whitening = np.linalg.inv(np.linalg.cholesky(ties.covariance))
        self.dims = 3 if settings.free_radius else 2
        self.height_information = np.zeros(self.dims)
        if settings.free_radius:
            self.height_information[2] = (settings.radius_sigma * target.mean_radius_km) ** -2.0
        self.constants = constants_of(cameras, settings)
        self.moves = np.zeros((len(poses), UNKNOWNS))
        self.places = places_at(target, ties.points.copy())
        self.height = np.zeros(len(ties.points))
        self.poses = list(poses)

    def solve(self) -> Bundle:
        """Steps, each followed by a new choice of the measures that count."""
        used, scale = np.ones(len(self.ties.image), bool), 1.0
        rounds, kept, still = 0, used, False
        while rounds < ROUNDS:
            rounds += 1
            system = self._system(used, scale, self._derivatives())
            still = self._step(system)
            residual = self.residual()
            scale = max(sigma_about_zero(self._components(residual)[used].ravel()), LEAST_SCALE) if used.any() else 1.0
            kept = self._in_company(self._sizes(residual) <= self.settings.reject_sigma * scale)
            if still and np.array_equal(kept, used):
                break
            used = kept
        covariance = system.pose_covariances()
        count = np.array([used[of].sum() for of in self.of_image])
        own = UNKNOWNS - np.einsum("kij,kji->k", self.information, covariance)
        return Bundle(
            poses=tuple(self.poses),
            moves=self.moves,
            covariance=covariance,
            points=self.points,
            point_sigma_km=system.point_sigmas(),
            residual_px=self.residual(),
            used=used,
            redundancy=np.clip(1 - own / np.maximum(2 * count, 1), 0, 1) * (count > 0),
            sigma_scale=scale,
            rounds=rounds,
            constants=self.constants,
            constants_covariance=system.shared_covariance,
        )

    @property
    def points(self) -> Array:
        """Points (m, 3) km with their heights."""
        up = np.cross(self.places.east, self.places.north)
        return np.asarray(self.places.points + self.height[:, None] * up)

    def residual(self) -> Array:
        """Measured minus computed pixels (n, 2)."""
        points, found = self.points, np.empty_like(self.ties.xy_px)
        for k, of in enumerate(self.of_image):
            seen = pixels_of_points(self.poses[k], self.cameras[k], points[self.ties.point[of]])
            found[of] = self.ties.xy_px[of] - self.constants.measured_at(k, seen)
        return found

    def _components(self, residual: Array) -> Array:
        return np.asarray(np.einsum("nij,nj->ni", self.whitening, residual))

    def _sizes(self, residual: Array) -> Array:
        """Residuals in sigmas (n,), of the larger of the two components."""
        return np.asarray(np.abs(self._components(residual)).max(axis=1))

    def _in_company(self, kept: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Measures of points that at least one other kept measure shows."""
        count = np.bincount(self.ties.point[kept], minlength=len(self.ties.points))
        return kept & (count >= 2)[self.ties.point]

    def _derivatives(self) -> tuple[Array, Array, Array]:
        """Of computed pixels by poses (n, 2, 7), by points (n, 2, dims) and by the cameras' constants (n, 2, unknowns);
        those of poses and points as if the constants were what they are known to be."""
        n = len(self.ties.image)
        by_pose, by_point = np.empty((n, 2, UNKNOWNS)), np.empty((n, 2, self.dims))
        by_constant = np.empty((n, 2, self.constants.count))
        points = self.points
        ways = [self.places.east, self.places.north, np.cross(self.places.east, self.places.north)][: self.dims]
        for image, (of, pose, camera) in enumerate(zip(self.of_image, self.poses, self.cameras, strict=True)):
            at = points[self.ties.point[of]]
            by_pose[of] = place_derivatives(pose, camera, at).transpose(0, 2, 1)
            if self.constants.count:
                by_constant[of] = self.constants.derivatives(image, pixels_of_points(pose, camera, at))
            for k, way in enumerate(ways):
                step = STEP_KM * way[self.ties.point[of]]
                ends = [pixels_of_points(pose, camera, at + sign * step) for sign in (1, -1)]
                by_point[of, :, k] = (ends[0] - ends[1]) / (2 * STEP_KM)
        return by_pose, by_point, by_constant

    def _system(self, used: NDArray[np.bool_], scale: float, derivatives: tuple[Array, Array, Array]) -> ReducedSystem:
        residual = self.residual()
        weight = used * huber_weight(self._sizes(residual) / scale, HUBER) / (scale**2 * self.ties.shared)
        root = np.sqrt(weight)[:, None]
        white_pose, white_point, white_constant = (self.whitening @ part * root[:, :, None] for part in derivatives)
        heights: Array = np.zeros((len(self.height), self.dims))
        if self.dims == 3:
            heights[:, 2] = self.height
        components: Array = np.asarray(self._components(residual) * root, np.float64)
        return ReducedSystem(
            white_pose,
            white_point,
            components,
            self.ties.image,
            self.ties.point,
            self.information,
            self.moves,
            self.height_information,
            heights,
            Shared(white_constant, self.constants.information, self.constants.moves),
        )

    def _step(self, system: ReducedSystem) -> bool:
        """One step; whether nothing moved any more."""
        moves, shifts, common = system.solve()
        self.moves = self.moves + moves
        self.constants = self.constants.moved(common)
        for k, (camera, move) in enumerate(zip(self.cameras, moves, strict=True)):
            change = np.zeros(len(NAMES))
            change[:UNKNOWNS] = move
            self.poses[k] = State(self.poses[k], 1.0).moved(change, camera).pose
        if self.dims == 3:
            self.height = self.height + shifts[:, 2]
        moved: Places = places_at(self.target, self.places.moved(self.target, shifts[:, :2]))
        self.places = moved
        still = np.abs(common) < SETTLED * np.sqrt(np.diag(system.shared_covariance))
        return bool((np.abs(moves) < SETTLED * system.rough_sigmas()).all() and still.all())
