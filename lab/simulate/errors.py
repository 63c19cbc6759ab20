"""The errors that simulated metadata have, drawn from what the paper found in the real ones."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from catalog.camera import Camera
from catalog.pose import Pose
from catalog.rotation import vector_deg_from_rotation
from catalog.target import Target
from lab.simulate.cameras import OffsetErrors
from lab.simulate.europa57 import PaperImage, paper_images
from lab.simulate.plant import planted
from lab.simulate.randomness import exponential_between

NEGATIVE_SHARE = 0.8
HALF_A_STEP = 0.00025
OUTLIER_DEG = 5.0
LIGHT_KM_PER_S = 299792.458


@dataclass(frozen=True)
class PlantedErrors:
    """offset_px: true minus predicted centre, undistorted pixels. range_factor: true over predicted range.
    attitude_deg: rotation vector, body-fixed axes, that turns the predicted body into the true one."""

    offset_px: tuple[float, float]
    range_factor: float
    attitude_deg: tuple[float, float, float]

    def predicted(self, truth: Pose, camera: Camera) -> Pose:
        """The wrong pose."""
        return planted(truth, camera, self.offset_px, self.range_factor, self.attitude_deg)

    def to_dict(self) -> dict[str, Any]:
        """Plain values."""
        return {
            "offset_px": list(self.offset_px),
            "range_factor": self.range_factor,
            "attitude_deg": list(self.attitude_deg),
        }


def drawn_errors(rng: np.random.Generator, camera: Camera, offsets: OffsetErrors, target: Target) -> PlantedErrors:
    """Errors of one image, after Belgacem et al. 2020.

    Offset: size along x and y with the mean, smallest and largest of table 2 (exponential between them); negative in 4
    of 5 cases ("the distributions are shifted in the negative values"; the share is ours).
    Range: one of the camera's published factors (figure 12; 1 for LORRI) and up to half the paper's step of 0.0005.
    Trajectories are far better than that (1e-5 to 1e-4): what the paper found there is its own error, and is planted
    all the same.
    Attitude: an angle that the paper's published attitude of one of the camera's images differs by from pck00010
    (0 to 1.7 deg; the outlier LOR_0035033162, 12.5 deg, left out), about any axis.
    """
    published = list(paper_images().values())
    own = [image for image in published if image.camera == camera.name] or published
    factor = own[rng.integers(len(own))].range_factor + rng.uniform(-HALF_A_STEP, HALF_A_STEP)
    angles = [angle for angle in (_attitude_deg(image, target) for image in own) if angle < OUTLIER_DEG]
    axis = rng.standard_normal(3)
    turn = axis / np.linalg.norm(axis) * angles[rng.integers(len(angles))]
    signs = np.where(rng.uniform(size=2) < NEGATIVE_SHARE, -1.0, 1.0)
    sizes = [exponential_between(rng, *along) for along in (offsets.x, offsets.y)]
    return PlantedErrors(
        offset_px=(float(signs[0] * sizes[0]), float(signs[1] * sizes[1])),
        range_factor=float(factor),
        attitude_deg=(float(turn[0]), float(turn[1]), float(turn[2])),
    )


def _attitude_deg(image: PaperImage, target: Target) -> float:
    """Angle between the published attitude and the IAU model's, at the time when the light left."""
    if target.rotation is None:
        return 0.0
    pose = image.pose
    iau = target.rotation.body_from_j2000(pose.et - pose.range_km / LIGHT_KM_PER_S)
    return float(np.linalg.norm(vector_deg_from_rotation(pose.body_from_j2000 @ iau.T)))
