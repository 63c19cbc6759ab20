"""planetpose: precise geometry of disk-resolved spacecraft images.

This is the public face: what `PUBLIC` lists may be relied on as docs/reference/api/planetpose.md promises. All other
modules (catalog, tasks, flows, lab, and those of this package) are private: they may change in any version.

    import planetpose

    result = planetpose.correct("C0552809300R.IMG", "out")
    cube = planetpose.open_cube(result["cube"])
    x, y = cube.planetpose.pixel_of(10.0, 220.0)

Names are imported when they are first used, so that `import planetpose` itself is quick.
"""

import warnings
from importlib import import_module
from typing import TYPE_CHECKING, Any

import planetpose_launcher

# Every public name, and the module that it is defined in: the one list of what is public.
PUBLIC = {
    "correct": "planetpose.correction",
    "Result": "planetpose.result",
    "stars": "planetpose.star_search",
    "open_store": "planetpose.cubes",
    "open_index": "tasks.publish.index",
    "open_cube": "planetpose.cubes",
    "backplanes": "planetpose.geometry",
    "pixel_of": "planetpose.geometry",
    "place_of": "planetpose.geometry",
    "CubeAccessor": "planetpose.accessor",
    "Position": "tasks.position.position",
    "model_of": "tasks.publish.cube_model",
    "CubeModel": "tasks.publish.cube_model",
    "Pose": "catalog.pose",
    "PartialPose": "catalog.pose",
    "read_pose_file": "catalog.pose",
    "write_pose_file": "catalog.pose",
    "Camera": "catalog.camera",
    "find_camera": "catalog.camera",
    "known_cameras": "catalog.camera",
    "Target": "catalog.body",
    "find_target": "catalog.target",
    "known_targets": "catalog.target",
    "PlanetposeError": "catalog.errors",
    "RefusedError": "catalog.errors",
    "FailedError": "catalog.errors",
    "Reader": "catalog.readers.reading",
    "Reading": "catalog.readers.reading",
    "ExposureTime": "catalog.readers.exposure_time",
    "Registration": "tasks.point.registration.base",
    "Match": "tasks.compare.match",
    "Shift": "tasks.point.registration.base",
    "Law": "tasks.simulate.photometry",
    "view": "viewer.notebook",
    "widget": "viewer.notebook",
    "HiddenModuleWarning": "planetpose.hidden",
}
__all__ = sorted([*PUBLIC, "__version__"])

if TYPE_CHECKING:
    from catalog.body import Target as Target
    from catalog.camera import Camera as Camera
    from catalog.camera import find_camera as find_camera
    from catalog.camera import known_cameras as known_cameras
    from catalog.errors import FailedError as FailedError
    from catalog.errors import PlanetposeError as PlanetposeError
    from catalog.errors import RefusedError as RefusedError
    from catalog.pose import PartialPose as PartialPose
    from catalog.pose import Pose as Pose
    from catalog.pose import read_pose_file as read_pose_file
    from catalog.pose import write_pose_file as write_pose_file
    from catalog.readers.exposure_time import ExposureTime as ExposureTime
    from catalog.readers.reading import Reader as Reader
    from catalog.readers.reading import Reading as Reading
    from catalog.target import find_target as find_target
    from catalog.target import known_targets as known_targets
    from planetpose.accessor import CubeAccessor as CubeAccessor
    from planetpose.correction import correct as correct
    from planetpose.cubes import open_cube as open_cube
    from planetpose.cubes import open_store as open_store
    from planetpose.geometry import backplanes as backplanes
    from planetpose.geometry import pixel_of as pixel_of
    from planetpose.geometry import place_of as place_of
    from planetpose.hidden import HiddenModuleWarning as HiddenModuleWarning
    from planetpose.result import Result as Result
    from planetpose.star_search import stars as stars
    from tasks.compare.match import Match as Match
    from tasks.point.registration.base import Registration as Registration
    from tasks.point.registration.base import Shift as Shift
    from tasks.position.position import Position as Position
    from tasks.publish.cube_model import CubeModel as CubeModel
    from tasks.publish.cube_model import model_of as model_of
    from tasks.publish.index import open_index as open_index
    from tasks.simulate.photometry import Law as Law
    from viewer.notebook import view as view
    from viewer.notebook import widget as widget

    __version__: str


def __getattr__(name: str) -> Any:
    """A public name, imported when it is first used (PEP 562)."""
    if name == "__version__":
        from tasks.publish.cube import software_version

        return software_version()
    if name not in PUBLIC:
        raise AttributeError(f"module 'planetpose' has no attribute {name!r}; public are {', '.join(__all__)}")
    found = getattr(import_module(PUBLIC[name]), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    """The public names."""
    return __all__


def _warn_of_hidden_modules() -> None:
    from planetpose.hidden import HiddenModuleWarning, warnings_of

    for text in warnings_of(planetpose_launcher.put_aside, planetpose_launcher.hidden()):
        warnings.warn(text, HiddenModuleWarning, stacklevel=3)


_warn_of_hidden_modules()
