"""Statistics of simulated images: how wrong metadata are, and what detectors do (`cameras.toml`)."""

import tomllib
from functools import cache
from pathlib import Path
from typing import NamedTuple

from pydantic import BaseModel, ConfigDict

from catalog.basemap import BaseMap, read_map
from catalog.errors import RefusedError
from catalog.reasons import Reason
from catalog.settings import data_folder
from catalog.target import Target

FILE = Path(__file__).parent / "cameras.toml"


class Sizes(NamedTuple):
    """Mean, smallest and largest of a quantity that is never negative."""

    mean: float
    smallest: float
    largest: float


class OffsetErrors(BaseModel):
    """Sizes of the metadata's offset along x and y, undistorted pixels."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    x: Sizes
    y: Sizes


class DetectorHabits(BaseModel):
    """What a detector does to a picture. peak_dn: range of the lit disk's brightness. dark_dn: sky in the middle and in
    the corners. cosmic_rays, spikes, gaps: mean numbers per frame. marks_shift_px: mean shift of the reseau marks."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    peak_dn: tuple[float, float]
    dark_dn: tuple[float, float]
    cosmic_rays: float
    spikes: float
    gaps: float
    marks_shift_px: tuple[float, float] = (0.0, 0.0)


class SimulatedCamera(BaseModel):
    """Both for one camera."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    offset_px: OffsetErrors
    detector: DetectorHabits


@cache
def simulated_cameras() -> dict[str, SimulatedCamera]:
    """Cameras that can be simulated, by name."""
    content = tomllib.loads(FILE.read_text())
    return {
        name: SimulatedCamera(offset_px=content["offset_px"][name], detector=detector)
        for name, detector in content["detector"].items()
    }


def simulated_camera(name: str) -> SimulatedCamera:
    """Statistics of the camera `name`. Raises RefusedError when there are none."""
    found = simulated_cameras().get(name)
    if found is None:
        raise RefusedError(
            Reason.CAMERA_NOT_SIMULATED,
            f"{FILE.name} of lab/simulate says nothing about camera {name!r}.",
            f"It knows {', '.join(simulated_cameras())}.",
        )
    return found


def other_map(target: Target) -> BaseMap | None:
    """A map of the target that is not the catalog's, from the folder of real data, moved to agree with that on the
    average; None when there is none."""
    folder = data_folder()
    entry = tomllib.loads(FILE.read_text())["other_map"].get(target.name)
    path = folder / entry["file"] if folder and entry else None
    if not path or not path.is_file():
        return None
    return read_map(path, entry["left_edge_deg"]).moved(entry["moved_north_deg"], entry["moved_east_deg"])
