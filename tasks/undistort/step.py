"""The cached step: undistort."""

from typing import Any

from tasks.plain import plain
from tasks.stored import camera_of, frame_of, save_observation
from tasks.undistort import UndistortSettings, undistort
from tasks.work import Work


def run(work: Work) -> dict[str, Any]:
    """See `undistort`; the observation goes into the step's folder."""
    frame = frame_of(work)
    settings = UndistortSettings.model_validate(work.inputs["settings"])
    undistorted = undistort(frame.observation, camera_of(work), settings, frame.undistorted)
    save_observation(work.folder, undistorted.observation)
    return {"model": undistorted.model.name, "evidence": plain(undistorted.evidence)}
