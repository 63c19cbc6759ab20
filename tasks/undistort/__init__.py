"""Undistort: from the raw frame of the detector to the pinhole frame of the camera (the paper's section 2)."""

from dataclasses import dataclass, field
from typing import Any

from catalog.camera import Camera
from catalog.errors import RefusedError
from catalog.observation import Observation
from catalog.reasons import Reason
from tasks.undistort.bending import bending_field
from tasks.undistort.choose import SeenMarks, chosen_model, table_of
from tasks.undistort.mark_fill import filled
from tasks.undistort.model import DistortionModel, Identity
from tasks.undistort.resample import resampled
from tasks.undistort.reseau_marks import find_marks
from tasks.undistort.settings import UndistortSettings

__all__ = ["DistortionModel", "UndistortSettings", "Undistorted", "seen_marks", "undistort"]


@dataclass(frozen=True)
class Undistorted:
    """observation: in the camera's undistorted frame, or (space `sensor`) in the raw one, but for filled marks. model:
    maps between the two. evidence: plain JSON values: method, space, kernel, marks found, errors of the fit ..."""

    observation: Observation
    model: DistortionModel
    evidence: dict[str, Any] = field(default_factory=dict)


def undistort(
    observation: Observation, camera: Camera, settings: UndistortSettings, already_undistorted: bool = False
) -> Undistorted:
    """Remove the camera's distortion from `observation`, or (space `sensor`) just provide the model.

    already_undistorted: the frame is in the undistorted geometry (GEOMED) and stays as it is. Raises RefusedError when
    the frame has not the camera's size, or the camera lacks what the method needs.
    """
    if already_undistorted:
        _refuse_other_size(observation, camera.size_px, camera, "undistorted")
        return Undistorted(observation, Identity(camera.size_px), {"method": "already undistorted"})
    _refuse_other_size(observation, camera.detector_size_px, camera, "raw")
    seen, clean = seen_marks(observation, camera)
    model, evidence = chosen_model(camera, settings, seen)
    observation = clean if settings.fill_marks else observation
    evidence = {**evidence, "space": settings.space, "kernel": settings.kernel}
    if settings.space == "sensor" or isinstance(model, Identity):
        return Undistorted(observation, model, evidence)
    return Undistorted(resampled(observation, model, settings.kernel), model, evidence)


def seen_marks(observation: Observation, camera: Camera) -> tuple[SeenMarks | None, Observation]:
    """The marks of a raw frame with the bending of its beam, and the frame with the marks filled; None and the frame
    itself for a camera without marks, a summed frame (its marks are too small), or a product that has none any more."""
    table = table_of(camera) if camera.unsummed is None else None
    if table is None:
        return None, observation
    marks = find_marks(observation, table)
    if not marks.found.any():
        return SeenMarks(marks), observation
    clean = filled(observation, marks)
    return SeenMarks(marks, bending_field(clean, camera.saturation_dn)), clean


def _refuse_other_size(observation: Observation, size_px: tuple[int, int], camera: Camera, frame: str) -> None:
    rows, columns = observation.image.shape
    if (columns, rows) != tuple(size_px):
        raise RefusedError(
            Reason.FRAME_SIZE,
            f"the image has {columns}x{rows} pixels, the {frame} frame of {camera.name} {size_px[0]}x{size_px[1]}.",
            "Give the right --camera, or a camera file with this size.",
        )
