"""The body that point, range and attitude share: load, correct, keep the Correction as plain values."""

from collections.abc import Callable
from typing import Any

from catalog.observation import Observation
from catalog.pose import Pose
from tasks.correction import Correction
from tasks.plain import plain
from tasks.simulate import Scene
from tasks.stored import load_observation, pose_in, scene_of
from tasks.work import Progress, Work

Corrector = Callable[[Observation, Pose, Scene, Any, Progress], Correction]


def run_correction(work: Work, corrector: Corrector, settings: Any) -> dict[str, Any]:
    """Apply `corrector` to the observation and pose that the work names."""
    observation = load_observation(work.place("undistort"))
    pose = pose_in(work.place("pose"))
    return plain_correction(corrector(observation, pose, scene_of(work), settings, work.progress))


def plain_correction(correction: Correction) -> dict[str, Any]:
    """A Correction as plain JSON values, its pose as in a pose file."""
    return {
        "pose": correction.pose.to_dict(),
        "changed": plain(correction.changed),
        "uncertainty": plain(correction.uncertainty),
        "evidence": plain(correction.evidence),
        "converged": correction.converged,
    }
