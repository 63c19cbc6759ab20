"""What every simulation of an image depends on, as steps are given it, and the scene that it makes."""

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from catalog.basemap import BaseMap, read_map, uniform_map
from catalog.digest import input_changed
from catalog.target import Target
from tasks.fields import CameraField, Content
from tasks.simulate import Scene, SceneSettings

MAPS_IN_MEMORY = 4


class BaseMapInputs(Content):
    """A base map by name and content. left_edge_deg: east longitude of its left edge."""

    name: str
    sha256: str
    left_edge_deg: float = 0.0


UNIFORM = BaseMapInputs(name="uniform", sha256="uniform")


class SceneInputs(Content):
    """observation: key of the step that left the undistorted image. simulate: settings of the rendering."""

    observation: str
    camera: CameraField
    target: Target
    basemap: BaseMapInputs
    simulate: SceneSettings


@dataclass(frozen=True)
class SceneFiles:
    """image: folder of the step that left the undistorted image. basemap: the map's file, None for a uniform one."""

    image: Path
    basemap: Path | None


def scene_of(inputs: SceneInputs, files: SceneFiles) -> Scene:
    """The scene to render. Raises RefusedError when the map's file is not the one of `inputs` any more."""
    basemap = _basemap(files.basemap, inputs.basemap.sha256, inputs.basemap.left_edge_deg)
    return Scene(inputs.camera, inputs.target, basemap, inputs.simulate)


@lru_cache(maxsize=MAPS_IN_MEMORY)
def _basemap(path: Path | None, sha256: str, left_edge_deg: float) -> BaseMap:
    basemap = read_map(path, left_edge_deg) if path else uniform_map()
    if basemap.sha256 != sha256:
        raise input_changed(f"base map {path}")
    return basemap
