"""Distortion models of cameras whose optics were calibrated once; see `catalog.distortions` for their formulas."""

from typing import Any

from catalog.camera import Camera
from catalog.optics import OPTICS_NAMES, OpticsModel, is_plain, optics_of
from tasks.undistort.model import Identity

__all__ = ["OPTICS_NAMES", "OpticsModel", "optics_model"]


def optics_model(name: str, camera: Camera, parameters: dict[str, Any]) -> OpticsModel | Identity:
    """The model `name` of `camera`; parameters as in the camera file's [distortion].

    Raises RefusedError for unknown names, and for missing or wrong parameters.
    """
    return Identity(camera.size_px) if is_plain(camera, name) else optics_of(camera, name, parameters)
