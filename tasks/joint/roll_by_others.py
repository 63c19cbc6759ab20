"""The camera's roll by the other bodies of the frame.

A turn of the camera about the sight of the target looks like a turn of the target itself: outline and markings tell
little of which it is. It moves other bodies, though, by their distance from the target: those whose limb is measured
give the roll, by what they are off across the line from the target. What they are off along it is the range's error.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.basemap import uniform_map
from catalog.camera import Camera
from catalog.errors import PlanetposeError
from catalog.observation import Observation
from catalog.pose import Pose
from tasks.bodies.masks import alone
from tasks.bodies.placed import Body, bodies_of, in_frame
from tasks.compare.limb_edges import FEWEST_POINTS, measure_limb
from tasks.compare.match import framed_window, match_scene
from tasks.joint.parameters import ROLL, State, difference, rolled
from tasks.point.by_limb import EDGES, SKY_PX, as_target_of
from tasks.priors import PriorSettings
from tasks.simulate import Scene

Array = NDArray[np.float64]


@dataclass(frozen=True)
class RollByOthers:
    """bodies: by whose limbs. roll_deg: of the camera, from the predicted pose's; sigma_deg: its 1-sigma."""

    bodies: tuple[str, ...]
    roll_deg: float
    sigma_deg: float

    def predicted(self, pose: Pose) -> Pose:
        """The predicted pose with this roll."""
        return rolled(pose, self.roll_deg)

    def priors(self, given: PriorSettings) -> PriorSettings:
        """Priors of that pose."""
        return given.model_copy(update={"roll_deg": self.sigma_deg})

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        return {"bodies": list(self.bodies), "roll_deg": self.roll_deg, "sigma_deg": self.sigma_deg}


def roll_by_others(
    observation: Observation, pose: Pose, predicted: Pose, scene: Scene, priors: PriorSettings
) -> RollByOthers | None:
    """The roll by all other bodies whose limb is measured, weighed with its prior. observation: the whole frame. pose:
    with the target where it is seen, to `roll_centre_px`; predicted: what the priors are about, facing the target as
    `pose` does. None where no body tells more than the prior, or where what they tell contradicts it."""
    limits = scene.settings.others
    if not pose.bodies or priors.roll_deg is None:
        return None
    roll = np.radians(priors.roll_deg)
    growth = min(priors.range_sigma(pose.range_km), limits.roll_range)
    turned = float(np.radians(difference(State(pose, 1.0), State(predicted, 1.0), scene.camera)[ROLL]))
    weight, wanted = np.diag([roll**-2, growth**-2]), np.array([-turned * roll**-2, 0.0])
    names = []
    for body in bodies_of(pose, scene.target):
        if body.place is None or not in_frame(body, scene.camera):
            continue
        seen = shown_by_limb(observation, pose, scene, body)
        if seen is not None:
            weight, wanted = weight + seen[0], wanted + seen[1]
            names.append(body.target.name)
    errors = np.linalg.inv(weight)
    found, sigma = turned + float((errors @ wanted)[0]), float(np.sqrt(errors[0, 0]))
    # The prior has a share in `found`: this is what the limbs alone say, less the prior's, by the error of that.
    if sigma > limits.roll_gain * roll or abs(found) > limits.roll_sigmas * np.sqrt(roll**2 - sigma**2):
        return None
    return RollByOthers(tuple(names), float(np.degrees(found)), float(np.degrees(sigma)))


def shown_by_limb(observation: Observation, pose: Pose, scene: Scene, body: Body) -> tuple[Array, Array] | None:
    """Information (2, 2) on roll (radians) and logarithm of the range's scale, relative to `pose`, by the edges of a
    body's limb, and that times their values (2,). The errors of its place relative to the target, of its relief and of
    the target's own place are a displacement of the whole limb. None where too few edges are measured."""
    limits, camera = scene.settings.others, scene.camera
    lit_px = body.radius_px(camera) * (1 + float(np.cos(np.radians(body.pose.phase_deg))))
    if lit_px < limits.least_lit_px or body.place is None:
        return None
    own, of_body = as_target_of(pose, scene.target, body), Scene(camera, body.target, uniform_map(), scene.settings)
    try:
        left = alone(observation, own, of_body, keep_behind=False)
        edges = measure_limb(match_scene(left, of_body, own, framed_window(of_body, own, margin_px=SKY_PX)), EDGES)
    except PlanetposeError:
        return None
    across, normal = edges.across_px, edges.segments.normal
    if len(across) < FEWEST_POINTS:
        return None
    along = camera.project(own.target_in_camera_km) - camera.project(pose.target_in_camera_km)
    columns = np.column_stack([normal @ (-along[1], along[0]), normal @ along, normal])
    place_px = per_km(camera, body) * np.hypot(body.place.relief_km, body.place.sigma_km)
    known = np.diag([0.0, 0.0, *[1 / (place_px**2 + limits.roll_centre_px**2)] * 2])
    middle = np.median(across)
    spread = max(1.4826 * float(np.median(np.abs(across - middle))), limits.roll_edge_px)
    near = np.abs(across - middle) <= limits.roll_sigmas * spread
    information = columns[near].T @ columns[near] / spread**2 + known
    shown = columns[near].T @ across[near] / spread**2
    # The displacement of the whole limb is eliminated.
    gain = information[:2, 2:] @ np.linalg.inv(information[2:, 2:])
    return information[:2, :2] - gain @ information[2:, :2], shown[:2] - gain @ shown[2:]


def per_km(camera: Camera, body: Body) -> float:
    """Pixels per kilometre at a body."""
    return float(camera.focal_length_px / body.pose.range_km)
