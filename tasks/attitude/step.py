"""The cached step: attitude."""

from tasks.attitude import AttitudeSettings, find_attitude
from tasks.attitude.markings import UNKNOWN_DEG
from tasks.correcting import CorrectionInputs, CorrectionResult, correction_step, recorded
from tasks.scene_inputs import SceneFiles, scene_of
from tasks.stored import load_observation
from tasks.work import Work


class AttitudeInputs(CorrectionInputs):
    """What the result depends on. attitude_prior_deg: 1-sigma of the predicted orientation, None if unknown."""

    attitude_prior_deg: float | None
    settings: AttitudeSettings


def run(inputs: AttitudeInputs, files: SceneFiles, work: Work) -> CorrectionResult:
    """How the body is turned, by the flow of its markings (see `find_attitude`)."""
    observation, scene = load_observation(files.image), scene_of(inputs.scene, files)
    prior_deg = inputs.attitude_prior_deg or UNKNOWN_DEG
    found = find_attitude(observation, inputs.pose, scene, inputs.settings, work.progress, prior_deg)
    return recorded(found, markings_match=not found.evidence.get("doubt"))


STEP = correction_step("attitude", run, AttitudeSettings, frozenset({"pose"}), frozenset({"attitude"}))
