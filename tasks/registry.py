"""Every step of an image, in the order of doing. Names, cache folders, provenance, documentation and the reasons why a
step is done again come from here."""

from typing import Any

from tasks.attitude.step import STEP as ATTITUDE
from tasks.closeup.step import STEP as CLOSEUP
from tasks.correcting import CorrectionStep
from tasks.diagnose.step import STEP as DIAGNOSE
from tasks.ingest.pose_step import STEP as POSE
from tasks.ingest.start_step import STEP as START
from tasks.ingest.step import STEP as INGEST
from tasks.initial_pose.step import STEP as IMAGE_POSE
from tasks.joint.step import STEP as JOINT
from tasks.objectstore.step import STEP as UPLOAD
from tasks.point.step import STEP as POINT
from tasks.publish.step import STEP as PUBLISH
from tasks.range.step import STEP as RANGE
from tasks.roll.step import STEP as ROLL
from tasks.stars.step import STEP as STARS
from tasks.step import StepType
from tasks.undistort.step import STEP as UNDISTORT
from tasks.validate.step import STEP as VALIDATE

CORRECTION_STEPS: tuple[CorrectionStep, ...] = (POINT, ROLL, RANGE, ATTITUDE, JOINT, CLOSEUP)
STEPS: tuple[StepType[Any, Any, Any], ...] = (
    *(INGEST, POSE, UNDISTORT, IMAGE_POSE, STARS, START),
    *CORRECTION_STEPS,
    *(VALIDATE, DIAGNOSE, PUBLISH, UPLOAD),
)
STEP_NAMES = tuple(step.name for step in STEPS)
CORRECTIONS: dict[str, CorrectionStep] = {step.name: step for step in CORRECTION_STEPS}
