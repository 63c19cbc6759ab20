"""The cached step: the pose that the metadata claim."""

from pathlib import Path
from typing import Any

from catalog.target import find_target
from tasks.ingest.pose import initial_pose
from tasks.plain import plain
from tasks.stored import camera_of, frame_of, given_target_of
from tasks.work import Work


def run(work: Work) -> dict[str, Any]:
    """See `initial_pose`. The target is looked up here too, for a kernel may define it."""
    frame = frame_of(work)
    kernels = [Path(path) for path in work.places["kernels"]]
    target = given_target_of(work) or find_target(str(frame.target), kernels)
    pose_file = work.places.get("pose_file")
    initial = initial_pose(frame, camera_of(work), target, kernels, Path(pose_file) if pose_file else None)
    return {
        "pose": initial.pose.to_dict(),
        "target": target.model_dump(mode="json"),
        "source": initial.source,
        "sources": plain(initial.sources),
        "missing": plain(initial.missing),
        "kernels": plain(initial.kernels),
        "evidence": plain(initial.evidence),
    }
