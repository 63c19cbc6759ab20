"""The cached step: point."""

from tasks.correcting import CorrectionInputs, CorrectionResult, correction_step, recorded
from tasks.point import PointSettings, find_pointing
from tasks.scene_inputs import SceneFiles, scene_of
from tasks.stored import load_observation
from tasks.work import Work


class PointInputs(CorrectionInputs):
    """What the result depends on. search_frame: whether the target may be anywhere in the frame."""

    search_frame: bool
    settings: PointSettings


def run(inputs: PointInputs, files: SceneFiles, work: Work) -> CorrectionResult:
    """Where in the frame the target is, by registering the image with the simulation (see `find_pointing`)."""
    settings = inputs.settings.model_copy(update={"coarse": inputs.settings.coarse and inputs.search_frame})
    observation, scene = load_observation(files.image), scene_of(inputs.scene, files)
    return recorded(find_pointing(observation, inputs.pose, scene, settings, work.progress))


STEP = correction_step("point", run, PointSettings, frozenset({"pose"}), frozenset({"offset"}))
