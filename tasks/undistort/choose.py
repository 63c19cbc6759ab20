"""From camera file and settings to a distortion model."""

from functools import cache
from typing import Any

from catalog.camera import Camera
from catalog.errors import RefusedError
from catalog.reseau import find_reseau_table
from tasks.undistort.delaunay import DelaunayModel
from tasks.undistort.model import DistortionModel
from tasks.undistort.optics import OPTICS_NAMES, optics_model
from tasks.undistort.settings import UndistortSettings


def chosen_model(camera: Camera, settings: UndistortSettings) -> tuple[DistortionModel, dict[str, Any]]:
    """The model that the settings choose for the camera, and evidence (plain values) about it.

    Raises RefusedError when the camera lacks what the method needs.
    """
    default = camera.distortion.model
    method = settings.method if settings.method != "camera" else ("delaunay" if default == "reseau" else default)
    if method in OPTICS_NAMES or default != "reseau":
        optics = optics_model(method, camera, _parameters(camera, method))
        return optics, {"method": optics.name}
    name = settings.marks if settings.marks != "nominal" else _table_name(camera)
    marks = _delaunay_of_table(name, camera.detector_size_px, camera.size_px)
    return marks, {"method": "delaunay", "marks": settings.marks, "table": name, "marks_used": marks.marks}


@cache
def _delaunay_of_table(name: str, raw_size_px: tuple[int, int], size_px: tuple[int, int]) -> DelaunayModel:
    table = find_reseau_table(name)
    return DelaunayModel(table.raw_xy, table.object_xy, raw_size_px, size_px)


def _parameters(camera: Camera, method: str) -> dict[str, Any]:
    """What [distortion] gives for its own model, or its sub-table [distortion.<method>] for another."""
    given = camera.distortion.parameters
    if method == camera.distortion.model:
        return {key: value for key, value in given.items() if not isinstance(value, dict)}
    return dict(given.get(method, {}))


def _table_name(camera: Camera) -> str:
    name = camera.distortion.parameters.get("table")
    if name is None:
        raise RefusedError(
            "distortion-incomplete",
            f"camera {camera.name}: distortion reseau names no table.",
            'Add table = "..." to the camera file\'s [distortion] section.',
        )
    return str(name)
