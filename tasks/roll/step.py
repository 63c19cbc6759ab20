"""The cached step: roll."""

from tasks.correcting import CorrectionInputs, CorrectionResult, correction_step, recorded
from tasks.roll import RollSettings, find_roll
from tasks.scene_inputs import SceneFiles, scene_of
from tasks.stored import load_observation
from tasks.work import Work


class RollInputs(CorrectionInputs):
    """What the result depends on."""

    settings: RollSettings


def run(inputs: RollInputs, files: SceneFiles, work: Work) -> CorrectionResult:
    """How far the camera is turned about its boresight (see `find_roll`)."""
    observation, scene = load_observation(files.image), scene_of(inputs.scene, files)
    return recorded(find_roll(observation, inputs.pose, scene, inputs.settings, work.progress))


STEP = correction_step("roll", run, RollSettings, frozenset({"pose"}), frozenset({"roll", "offset", "attitude"}))
