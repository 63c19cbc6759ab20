"""The cached step: range."""

from tasks.correcting import CorrectionInputs, CorrectionResult, recorded
from tasks.range import RangeSettings, find_range
from tasks.scene_inputs import SceneFiles, scene_of
from tasks.step import StepType
from tasks.stored import load_observation
from tasks.work import Work


class RangeInputs(CorrectionInputs):
    """What the result depends on."""

    settings: RangeSettings


def run(inputs: RangeInputs, files: SceneFiles, work: Work) -> CorrectionResult:
    """How far away the target is (see `find_range`)."""
    observation, scene = load_observation(files.image), scene_of(inputs.scene, files)
    return recorded(find_range(observation, inputs.pose, scene, inputs.settings, work.progress))


STEP = StepType("range", run, CorrectionResult, RangeSettings, changes=frozenset({"pose"}))
