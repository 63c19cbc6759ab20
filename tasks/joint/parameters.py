"""What the joint estimator moves: eight unknowns, their units, and the pose that a step of them leads to."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera
from catalog.pose import Pose
from catalog.rotation import rotation_from_vector_deg, vector_deg_from_rotation
from tasks.point.rotation import pose_moved_by

Array = NDArray[np.float64]

# offset: px of the target's centre. range: logarithm of the factor. roll: degrees, camera about the line to the target.
# attitude: degrees, rotation vector of the body about its own axes. psf: logarithm of the Gaussian width.
NAMES = ("x", "y", "range", "roll", "attitude_x", "attitude_y", "attitude_z", "psf")
OFFSET, RANGE, ROLL, ATTITUDE, PSF = slice(0, 2), 2, 3, slice(4, 7), 7
GROUPS: dict[str, tuple[int, ...]] = {
    "offset": (0, 1),
    "range": (2,),
    "roll": (3,),
    "attitude": (4, 5, 6),
    "psf": (7,),
}


@dataclass(frozen=True)
class State:
    """A trial solution: the pose, the Gaussian PSF width, pixels, and the line (x, y), pixels, along which the exposure
    is smeared evenly; (0, 0) without smear, and its sign has no meaning."""

    pose: Pose
    psf_sigma_px: float
    trail_px: tuple[float, float] = (0.0, 0.0)

    @property
    def width_px(self) -> float:
        """RMS width of the PSF along one axis, the trail included: pixels."""
        return float(np.sqrt(self.psf_sigma_px**2 + np.square(self.trail_px).sum() / 24))

    def moved(self, step: Array, camera: Camera) -> "State":
        """The state after a step (8,) of the unknowns."""
        pose = pose_moved_by(self.pose, camera, step[OFFSET]).with_range_factor(float(np.exp(step[RANGE])))
        pose = rolled(pose, float(step[ROLL]))
        turn = rotation_from_vector_deg(step[ATTITUDE])
        pose = pose.replaced(body_from_j2000=turn.T @ pose.body_from_j2000)
        return State(pose, float(self.psf_sigma_px * np.exp(step[PSF])), self.trail_px)

    def trailed(self, step_px: Array) -> "State":
        """The state with its trail lengthened by a step (2,); itself without one (0,)."""
        if len(step_px) == 0:
            return self
        x, y = np.asarray(self.trail_px) + step_px
        return State(self.pose, self.psf_sigma_px, (float(x), float(y)))


def with_psf_within(step: Array, largest: float) -> Array:
    """A step (8,) of a linear update, its change of the PSF's width (natural logarithm) no larger than `largest`: what
    other unknowns make of the PSF by their correlation holds no farther."""
    bounded = np.array(step, dtype=np.float64)
    bounded[PSF] = np.clip(bounded[PSF], -largest, largest)
    return bounded


def rolled(pose: Pose, roll_deg: float) -> Pose:
    """Pose whose camera sees the target turned by `roll_deg` about the line of sight, from +x towards +y; its centre
    stays."""
    sight = pose.target_in_camera_km / pose.range_km
    return pose.replaced(camera_from_j2000=rotation_from_vector_deg(roll_deg * sight) @ pose.camera_from_j2000)


def difference(state: State, start: State, camera: Camera) -> Array:
    """The step (8,) from `start` to `state`, in the unknowns' units."""
    step = np.zeros(len(NAMES))
    step[OFFSET] = camera.project(state.pose.target_in_camera_km) - camera.project(start.pose.target_in_camera_km)
    step[RANGE] = np.log(state.pose.range_km / start.pose.range_km)
    pointed = pose_moved_by(start.pose, camera, step[OFFSET])
    between = vector_deg_from_rotation(state.pose.camera_from_j2000 @ pointed.camera_from_j2000.T)
    step[ROLL] = between @ state.pose.target_in_camera_km / state.pose.range_km
    step[ATTITUDE] = vector_deg_from_rotation((state.pose.body_from_j2000 @ start.pose.body_from_j2000.T).T)
    step[PSF] = np.log(state.psf_sigma_px / start.psf_sigma_px)
    return step
