"""The cached step: closeup."""

from tasks.closeup.find import find_close_up
from tasks.closeup.settings import CloseUpSettings
from tasks.correcting import CorrectionInputs, CorrectionResult, correction_step, recorded
from tasks.fields import PoseField
from tasks.priors import PriorSettings
from tasks.scene_inputs import SceneFiles, scene_of
from tasks.stored import load_observation
from tasks.work import Work


class CloseUpInputs(CorrectionInputs):
    """What the result depends on. predicted: what the priors are about."""

    predicted: PoseField
    priors: PriorSettings
    settings: CloseUpSettings


def run(inputs: CloseUpInputs, files: SceneFiles, work: Work) -> CorrectionResult:
    """Pointing, roll and range of a frame with little or no limb, by patches of the base map (see `find_close_up`)."""
    correction = find_close_up(
        load_observation(files.image),
        inputs.pose,
        inputs.predicted,
        scene_of(inputs.scene, files),
        inputs.settings,
        inputs.priors,
        work.progress,
    )
    return recorded(correction)


STEP = correction_step("closeup", run, CloseUpSettings, frozenset({"pose"}), frozenset({"offset"}))
