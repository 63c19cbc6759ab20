"""What steps leave for later steps: arrays in Zarr beside the record, and the objects that are built from records.

The last few objects are kept in memory, so that the steps of one image that run in one process load them once.
"""

from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.basemap import BaseMap, read_map, uniform_map
from catalog.camera import Camera, camera_from_dict
from catalog.digest import input_changed
from catalog.flips import Flip
from catalog.observation import Frame, Observation
from catalog.pose import Pose
from catalog.readers import read_frame
from catalog.target import Target
from tasks.record import record_in
from tasks.simulate import Scene, SceneSettings
from tasks.work import Work

ARRAYS = "arrays.zarr"
IMAGES_IN_MEMORY = 4


def save_arrays(folder: Path, **arrays: NDArray[Any]) -> None:
    """Write named arrays into `folder`, one chunk each."""
    import zarr

    group = zarr.open_group(str(folder / ARRAYS), mode="w")
    for name, values in arrays.items():
        stored = group.create_array(
            name, shape=values.shape, dtype=values.dtype, chunks=tuple(max(n, 1) for n in values.shape)
        )
        stored[...] = values


def load_arrays(folder: Path) -> dict[str, NDArray[Any]]:
    """All arrays that `save_arrays` wrote into `folder`."""
    import zarr

    group = zarr.open_group(str(folder / ARRAYS), mode="r")
    return {name: np.asarray(stored[...]) for name, stored in group.arrays()}


def save_observation(folder: Path, observation: Observation) -> None:
    """Write image, noise and quality into `folder`."""
    save_arrays(folder, image=observation.image, noise=observation.noise, quality=observation.quality)


@lru_cache(maxsize=IMAGES_IN_MEMORY)
def load_observation(folder: Path) -> Observation:
    """What `save_observation` wrote; its arrays are read-only, for they are shared."""
    arrays = load_arrays(folder)
    for values in arrays.values():
        values.setflags(write=False)
    return Observation(**arrays)


def frame_of(work: Work) -> Frame:
    """The image file of the work, read with the user's camera and target."""
    given = given_target_of(work)
    name = work.inputs.get("target_name") if given is None else given.name
    chosen = work.places.get("camera"), name, work.inputs.get("flip")
    return _frame(work.place("image"), work.inputs["image"], *chosen)


@lru_cache(maxsize=IMAGES_IN_MEMORY)
def _frame(path: Path, sha256: str, camera: str | None, target: str | None, flip: Flip | None) -> Frame:
    frame = read_frame(path, camera, target, flip)
    if frame.sha256 != sha256:
        raise input_changed(f"image {path}")
    return frame


def given_target_of(work: Work) -> Target | None:
    """The target of the user's own file; None where the user gave a name or nothing."""
    given = work.inputs.get("target_name")
    return Target.model_validate(given) if isinstance(given, dict) else None


def camera_of(work: Work) -> Camera:
    """The camera in the work's inputs."""
    return camera_from_dict(dict(work.inputs["camera"]), "in the step's record")


def target_of(work: Work) -> Target:
    """The target in the work's inputs."""
    return Target.model_validate(work.inputs["target"])


def scene_of(work: Work) -> Scene:
    """Camera, target, base map and rendering settings in the work's inputs."""
    basemap = work.inputs["basemap"]
    return Scene(
        camera_of(work),
        target_of(work),
        _basemap(work.places.get("basemap"), basemap["sha256"], basemap["left_edge_deg"]),
        SceneSettings.model_validate(work.inputs["simulate"]),
    )


@lru_cache(maxsize=IMAGES_IN_MEMORY)
def _basemap(path: str | None, sha256: str, left_edge_deg: float) -> BaseMap:
    basemap = read_map(Path(path), left_edge_deg) if path else uniform_map()
    if basemap.sha256 != sha256:
        raise input_changed(f"base map {path}")
    return basemap


def pose_in(folder: Path) -> Pose:
    """The pose that the step in `folder` ended with."""
    return Pose.from_dict(record_in(folder).result["pose"])
