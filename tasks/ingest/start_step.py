"""The cached step: the pose from which the corrections start, where the user overrules the predicted one."""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field

from catalog.camera import Camera
from catalog.errors import RefusedError
from catalog.pose import Pose
from catalog.reasons import Reason
from tasks.fields import Amounts, CameraField, Content, PlainAmounts, PoseField
from tasks.joint.parameters import ATTITUDE, ROLL, State, difference
from tasks.plain import plain
from tasks.point.rotation import pose_facing, pose_pointed_at
from tasks.step import StepType
from tasks.work import NoFiles, Work

SAME_EXPOSURE_S = 1.0
# A centre farther outside than so many frames is a slip: no part of a disk whose limb can be measured would be inside.
FRAMES_AWAY = 20


class StartInputs(Content):
    """What the result depends on. start_offset_px: added to the predicted centre. resume: pose of an earlier result."""

    camera: CameraField
    predicted: PoseField
    start_offset_px: tuple[float, float] | None
    resume: PoseField | None


class StartResult(Content):
    """pose: where the corrections start. changed, uncertainty: what of it a product states as a correction."""

    pose: PoseField
    centre_px: tuple[float, float] | None
    changed: PlainAmounts
    uncertainty: PlainAmounts = Field(default_factory=dict)


def run(inputs: StartInputs, _: NoFiles, __: Work) -> StartResult:
    """The pose that the corrections start from: the predicted one, or an earlier result, moved by the user's offset.

    Raises RefusedError when the pose to resume from is of another exposure, or the centre to move is behind the camera.
    """
    predicted, camera, offset_px = inputs.predicted, inputs.camera, inputs.start_offset_px
    start = predicted if inputs.resume is None else resumed(inputs.resume, predicted)
    if offset_px is not None:
        if not np.isfinite(camera.project(start.target_in_camera_km)).all():
            raise RefusedError(
                Reason.TARGET_BEHIND_CAMERA,
                "the predicted target is behind the camera, so that its centre has no place to be moved from.",
                "Check camera_from_j2000, or leave --start-offset out: the whole frame is searched then.",
            )
        start = pose_pointed_at(start, camera, started_at(start, camera, offset_px))
    centre = camera.project(start.target_in_camera_km)
    return StartResult(
        pose=start,
        centre_px=(float(centre[0]), float(centre[1])) if np.isfinite(centre).all() else None,
        changed={} if inputs.resume is None else turned(predicted, start, camera),
    )


def started_at(pose: Pose, camera: Camera, offset_px: ArrayLike) -> NDArray[np.float64]:
    """Pixel (2,) that the user's offset moves the centre to. Raises RefusedError when it is nowhere near the frame."""
    before = camera.project(pose.target_in_camera_km)
    wanted = before + np.asarray(offset_px, np.float64)
    # The centre of a close-up's target is far outside already.
    farthest = max(FRAMES_AWAY * max(camera.size_px), np.abs(before - camera.centre_px).max() + max(camera.size_px))
    if not np.abs(wanted - camera.centre_px).max() <= farthest:
        raise RefusedError(
            Reason.START_OUTSIDE_FRAME,
            f"--start-offset moves the target's predicted centre ({before[0]:.6g}, {before[1]:.6g}) to "
            f"({wanted[0]:.6g}, {wanted[1]:.6g}), far outside the frame of {camera.size_px[0]}x{camera.size_px[1]} px.",
            "Give the pixels from the predicted centre to the true one, or leave it out: the whole frame is searched.",
        )
    return np.asarray(wanted)


def turned(predicted: Pose, start: Pose, camera: Camera) -> Amounts:
    """Roll of the camera and turn of the body that are resumed, in the words of corrections."""
    step = difference(State(start, 1.0), State(pose_facing(predicted, start, camera), 1.0), camera)
    return {"roll_deg": float(step[ROLL]), "attitude_deg": plain(step[ATTITUDE])}


def resumed(earlier: Pose, predicted: Pose) -> Pose:
    """Pointing, place and attitude of an earlier result, with what is known today of time and velocities."""
    apart_s = abs(earlier.et - predicted.et)
    if apart_s > SAME_EXPOSURE_S:
        raise RefusedError(
            Reason.RESUME_OTHER_IMAGE,
            f"the pose to resume from is of {earlier.to_dict()['utc']}, {apart_s:.0f} s from this image's.",
            "Give --resume the product folder of this very image, or the store that holds it.",
        )
    return predicted.replaced(
        camera_from_j2000=earlier.camera_from_j2000,
        target_from_spacecraft_km=earlier.target_from_spacecraft_km,
        body_from_j2000=earlier.body_from_j2000,
    )


STEP = StepType(
    "start",
    run,
    StartResult,
    changes=frozenset({"pose"}),
    labels={"start_offset_px": "start offset", "resume": "pose to resume from"},
)
