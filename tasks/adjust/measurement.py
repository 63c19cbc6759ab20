"""One image's joint result as a measurement: what the picture alone says of range, roll, attitude and blur."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera
from catalog.errors import RefusedError
from catalog.pose import Pose
from catalog.reasons import Reason
from catalog.rotation import rotation_from_vector_deg, vector_deg_from_rotation
from catalog.target import Target
from tasks.joint.parameters import ATTITUDE, NAMES, OFFSET, PSF, RANGE, ROLL, State
from tasks.stars.separate import StarOrientation

Array = NDArray[np.float64]
LIGHT_KM_S = 299792.458
# The shared unknowns: all but the centre.
SHARED = tuple(range(OFFSET.stop, len(NAMES)))
NOT_JOINT = Reason.NOT_JOINT


@dataclass(frozen=True)
class Measurement:
    """step (8,): from the predicted state to the one the image wants with its range free, covariance (8, 8) its errors,
    both in the order and units of `joint.parameters.NAMES`; sigmas (8,): priors about zero that are part of both, inf
    where free; held (8,). range_sigma: 1-sigma error of the trajectory, inf when unknown. noise: (8, 8), the part of
    the errors that another exposure draws anew; zero counts all as shared by the images of a sequence. stars: the
    camera's orientation by the image's own stars, which the predicted pose then has and the roll is held by."""

    product: str
    camera: Camera
    target: Target
    predicted: Pose
    psf_sigma_px: float
    step: Array
    covariance: Array
    sigmas: Array
    held: NDArray[np.bool_]
    range_sigma: float
    noise: Array = field(default_factory=lambda: np.zeros((len(NAMES),) * 2))
    stars: StarOrientation | None = None

    @property
    def reference(self) -> Array:
        """Rotation (3, 3) from J2000 to the body that turns are relative to: the rotation model's when the light left;
        without a model, the predicted one."""
        model = self.target.rotation
        if model is None:
            return self.predicted.body_from_j2000
        return np.asarray(model.body_from_j2000(self.predicted.et - self.predicted.range_km / LIGHT_KM_S))

    @cached_property
    def turn_offset_deg(self) -> Array:
        """What is added to the attitude of `step` to have it relative to the reference (3,)."""
        wanted = rotation_from_vector_deg(self.step[ATTITUDE]).T @ self.predicted.body_from_j2000
        turn = vector_deg_from_rotation((wanted @ self.reference.T).T)
        return np.asarray(turn - self.step[ATTITUDE])

    @cached_property
    def information(self) -> tuple[Array, Array]:
        """Matrix (6, 6) and vector (6,) of the picture's information on range, roll, attitude and blur, the priors
        taken out: normal matrix N and right side N z. Attitude is relative to the reference."""
        free = np.array([place for place in SHARED if not self.held[place]])
        matrix, right = np.zeros((len(SHARED),) * 2), np.zeros(len(SHARED))
        if not len(free):
            return matrix, right
        scale = np.sqrt(np.diag(self.covariance)[free])
        inverse = np.linalg.inv(self.covariance[np.ix_(free, free)] / np.outer(scale, scale))
        scaled_prior = np.diag((scale / self.sigmas[free]) ** 2)
        values, vectors = np.linalg.eigh(inverse - scaled_prior)
        # Where robust errors are larger than the prior allows, the picture says nothing.
        observed = values > 1e-9 * values.max()
        kept = (vectors[:, observed] * values[observed]) @ vectors[:, observed].T
        vector = vectors[:, observed] @ vectors[:, observed].T @ inverse @ (self.step[free] / scale)
        places = free - OFFSET.stop
        matrix[np.ix_(places, places)] = kept / np.outer(scale, scale)
        right[places] = vector / scale
        moved = np.zeros(len(SHARED))
        moved[ATTITUDE.start - OFFSET.stop : ATTITUDE.stop - OFFSET.stop] = self.turn_offset_deg
        return matrix, right + matrix @ moved

    def state_with(self, shared: Array, range_log: float) -> State:
        """The state when the shared unknowns are `shared` (6,); the centre follows by its correlation with them.
        range_log: of the factor of the pose, that part of `shared`[0] which is not the camera's focal length."""
        step = self.step.copy()
        wanted = shared.copy()
        turn = slice(ATTITUDE.start - OFFSET.stop, ATTITUDE.stop - OFFSET.stop)
        body = rotation_from_vector_deg(shared[turn]).T @ self.reference
        wanted[turn] = vector_deg_from_rotation((body @ self.predicted.body_from_j2000.T).T)
        free = np.array([place for place in SHARED if not self.held[place]], int)
        if len(free):
            change = wanted[free - OFFSET.stop] - self.step[free]
            scale = np.sqrt(np.diag(self.covariance)[free])
            inner = self.covariance[np.ix_(free, free)] / np.outer(scale, scale)
            step[OFFSET] += (
                (self.covariance[OFFSET, free] / scale) @ np.linalg.pinv(inner, rcond=1e-12) @ (change / scale)
            )
            step[free] = wanted[free - OFFSET.stop]
        if not self.held[RANGE]:
            step[RANGE] = range_log
        return State(self.predicted, self.psf_sigma_px).moved(step, self.camera)


def measurement_of(
    product: str,
    camera: Camera,
    target: Target,
    predicted: Pose,
    settings: Mapping[str, Any],
    provenance: Any,
    stars: StarOrientation | None = None,
) -> Measurement:
    """The measurement in a cube's attributes. Raises RefusedError when the joint step was not done."""
    joint = _last_joint(product, provenance)
    evidence, source = joint["evidence"], provenance["initial_pose"]["source"]
    priors = settings["joint"]["priors"][source]
    sigmas = np.full(len(NAMES), np.inf)
    for places, key in (([ROLL], "roll_deg"), (ATTITUDE, "attitude_deg"), ([PSF], "psf_relative")):
        sigmas[places] = np.inf if priors[key] is None else priors[key]
    held = np.zeros(len(NAMES), bool)
    for name in evidence["held"]:
        held[NAMES.index(name)] = True
    # Roll by stars is no roll of the camera's mounting, and is known better than the disk shows it.
    held[ROLL] |= stars is not None
    prior = evidence["range_factor_prior_sigma"]
    step = np.array(evidence["predicted_to_free"])
    return Measurement(
        product=product,
        camera=camera,
        target=target,
        predicted=predicted,
        psf_sigma_px=float(joint["changed"]["psf_sigma_px"] / np.exp(step[PSF])),
        step=step,
        covariance=without_focal_length(evidence, free_covariance(evidence, joint["uncertainty"]["range_factor_free"])),
        sigmas=sigmas,
        held=held,
        range_sigma=np.inf if prior is None else float(prior),
        noise=np.array(evidence.get("noise_covariance", np.zeros((len(NAMES),) * 2))),
        stars=stars,
    )


def free_covariance(evidence: Mapping[str, Any], free_sigma: float | None) -> Array:
    """Covariance (8, 8) with the range free. Products of version 0.1 hold only the one after the range was weighed
    against its prior by one step of a Kalman filter; that step is undone."""
    if "free_covariance" in evidence:
        return np.array(evidence["free_covariance"])
    covariance, prior = np.array(evidence["covariance"]), evidence["range_factor_prior_sigma"]
    if prior is None or not free_sigma:
        return covariance
    both = free_sigma**2 + prior**2
    with_range = covariance[:, RANGE] * both / prior**2
    return np.asarray(covariance + np.outer(with_range, with_range) / both)


def without_focal_length(evidence: Mapping[str, Any], covariance: Array) -> Array:
    """Covariance (8, 8) without the focal length's error, which images of one camera share and the adjustment finds."""
    own = covariance.copy()
    if "range" not in evidence["held"]:
        own[RANGE, RANGE] -= float(evidence.get("focal_length_sigma", 0.0)) ** 2
    return own


def _last_joint(product: str, provenance: Any) -> Any:
    found = [result for name, result in provenance.get("corrections", {}).items() if name.startswith("joint")]
    if not found or "predicted_to_free" not in found[-1]["evidence"]:
        raise RefusedError(
            NOT_JOINT, f"{product} was not corrected by the joint step.", "Correct it with a profile that has it."
        )
    if found[-1]["evidence"]["predicted_to_free"] is None:
        raise RefusedError(
            Reason.TARGET_BEHIND_CAMERA,
            f"the predicted pose of {product} looks away from the target, so that there is no offset to adjust.",
            "Correct it with a pose file whose camera_from_j2000 has the target in front.",
        )
    return found[-1]
