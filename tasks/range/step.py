"""The cached step: range."""

from tasks.correcting import CorrectionInputs, CorrectionResult, correction_step, recorded
from tasks.range import RangeSettings, find_range
from tasks.scene_inputs import SceneFiles, scene_of
from tasks.stored import load_observation
from tasks.work import Work


class RangeInputs(CorrectionInputs):
    """What the result depends on."""

    settings: RangeSettings


def run(inputs: RangeInputs, files: SceneFiles, work: Work) -> CorrectionResult:
    """How far away the target is (see `find_range`)."""
    observation, scene = load_observation(files.image), scene_of(inputs.scene, files)
    return recorded(find_range(observation, inputs.pose, scene, inputs.settings, work.progress))


STEP = correction_step("range", run, RangeSettings, frozenset({"pose"}), frozenset({"range", "offset"}))
