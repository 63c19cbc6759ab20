"""Range: the methods by name."""

from collections.abc import Callable
from typing import Literal

from pydantic import BaseModel, ConfigDict

from catalog.observation import Observation
from catalog.pose import Pose
from tasks.bodies.masks import alone
from tasks.correction import Correction
from tasks.range.limb import LimbRangeSettings, find_range_by_limb
from tasks.range.similarity_scan import ScanSettings, find_range_by_similarity
from tasks.simulate import Scene

Progress = Callable[[str, int, str], None]


class RangeSettings(BaseModel):
    """method: `ssim` scans the structural similarity (the paper), `limb` fits the lit limb; each has its settings."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    method: Literal["ssim", "limb"] = "ssim"
    ssim: ScanSettings = ScanSettings()
    limb: LimbRangeSettings = LimbRangeSettings()


def find_range(
    observation: Observation, pose: Pose, scene: Scene, settings: RangeSettings, progress: Progress | None = None
) -> Correction:
    """Correct the distance to the target, and the pointing that a wrong distance had spoilt, by the chosen method.

    Raises FailedError when the method finds no answer within its limits.
    """
    observation = alone(observation, pose, scene)
    if settings.method == "limb":
        return find_range_by_limb(observation, pose, scene, settings.limb, progress)
    return find_range_by_similarity(observation, pose, scene, settings.ssim, progress)
