"""The cached step: joint."""

from typing import Any

from tasks.correcting import plain_correction
from tasks.joint import JointSettings, find_pose_jointly
from tasks.stored import load_observation, pose_in, scene_of
from tasks.work import Work


def run(work: Work) -> dict[str, Any]:
    """See `find_pose_jointly`."""
    settings = JointSettings.model_validate(work.inputs["settings"])
    observation = load_observation(work.place("undistort"))
    start, predicted = pose_in(work.place("pose")), pose_in(work.place("predicted"))
    source = work.inputs["pose_source"]
    return plain_correction(
        find_pose_jointly(observation, start, predicted, source, scene_of(work), settings, work.progress)
    )
