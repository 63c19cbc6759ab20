"""A camera's calibrated optics: from raw detector pixels to the pixels of its undistorted frame and back."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catalog.distortions import DISTORTIONS, Plate
from catalog.errors import RefusedError
from catalog.focal_plane import FocalPlane
from catalog.newton import PointMap, Points, solve_points
from catalog.reasons import Reason

OPTICS_NAMES = tuple(DISTORTIONS)
RESEAU = "reseau"


class Bending(Protocol):
    """A camera file's [distortion]."""

    @property
    def model(self) -> str:
        """The model's name."""
        ...

    @property
    def parameters(self) -> Mapping[str, Any]:
        """Everything beside it."""
        ...


class Lens(Protocol):
    """What of a camera its optics are made of (`catalog.camera.Camera`)."""

    @property
    def name(self) -> str:
        """The camera's name."""
        ...

    @property
    def distortion(self) -> Bending:
        """Distortion model and parameters."""
        ...

    @property
    def size_px(self) -> tuple[int, int]:
        """Size of the undistorted frame."""
        ...

    @property
    def detector_size_px(self) -> tuple[int, int]:
        """Size of the raw frame."""
        ...

    @property
    def centre_px(self) -> tuple[float, float]:
        """Where the boresight falls in the undistorted frame."""
        ...

    @property
    def pixel_pitch_mm(self) -> float | None:
        """Pitch of the undistorted frame."""
        ...

    @property
    def focal_length_mm(self) -> float | None:
        """Focal length."""
        ...

    @property
    def focal_plane(self) -> FocalPlane | None:
        """The detector in the focal plane."""
        ...


@dataclass(frozen=True)
class OpticsModel:
    """Detector pixel, affine map to the focal plane, distortion, and the camera's axes: the pixel of the undistorted
    frame.

    forward: the distortion, millimetres of the focal plane (n, 2) on one side to those on the other, inverted by
    Newton's method; forward_is_distort tells whether it leads from undistorted to raw. pitch_mm: of the undistorted
    frame.
    """

    name: str
    raw_size_px: tuple[int, int]
    size_px: tuple[int, int]
    centre_px: tuple[float, float]
    pitch_mm: float
    plane: FocalPlane
    forward: PointMap
    forward_is_distort: bool

    def undistort_points(self, xy_raw: ArrayLike) -> Points:
        """Undistorted places (..., 2) of raw pixels (..., 2)."""
        mm = self._mapped(self.plane.mm(np.asarray(xy_raw, dtype=np.float64)), inverse=self.forward_is_distort)
        return mm @ self._axes.T / self.pitch_mm + self.centre_px

    def distort_points(self, xy: ArrayLike) -> Points:
        """Raw places (..., 2) of undistorted pixels (..., 2)."""
        offset = (np.asarray(xy, dtype=np.float64) - self.centre_px) * self.pitch_mm
        return self.plane.px(self._mapped(offset @ self._axes, inverse=not self.forward_is_distort))

    @property
    def _axes(self) -> NDArray[np.float64]:
        return np.array(self.plane.axes, dtype=np.float64)

    def _mapped(self, mm: Points, inverse: bool) -> Points:
        if not inverse:
            return self.forward(mm.reshape(-1, 2)).reshape(mm.shape)
        pitch = self.pitch_mm  # in pixels, which the solver's tolerances mean
        return solve_points(lambda px: self.forward(px * pitch) / pitch, mm / pitch, mm / pitch) * pitch

    def extrapolated(self, xy: ArrayLike) -> NDArray[np.bool_]:
        """False everywhere: the formula holds for the whole frame."""
        return np.zeros(np.shape(xy)[:-1], dtype=bool)

    def uncertainty_px(self, xy: ArrayLike) -> NDArray[np.float64]:
        """Zero: the calibrations state no error of the distortion."""
        return np.zeros(np.shape(xy)[:-1])


def optics_of(camera: Lens, name: str | None = None, parameters: Mapping[str, Any] | None = None) -> OpticsModel:
    """The camera's optics with its own distortion, or with the model `name` and the given parameters.

    Raises RefusedError for unknown names, missing or wrong parameters, and for a camera whose distortion is measured on
    its reseau marks.
    """
    name = camera.distortion.model if name is None else name
    given = parameters
    if given is None:
        given = {key: value for key, value in camera.distortion.parameters.items() if not isinstance(value, dict)}
    if name not in DISTORTIONS:
        raise RefusedError(
            Reason.DISTORTION_UNKNOWN,
            f"camera {camera.name} names the distortion model {name!r}"
            + (", which is measured on the marks of each image." if name == RESEAU else "."),
            f"Known are {', '.join(OPTICS_NAMES)} and {RESEAU}.",
        )
    build, forward_is_distort = DISTORTIONS[name]
    plate = Plate(camera.pixel_pitch_mm, camera.focal_length_mm, 0.5 * float(np.hypot(*camera.detector_size_px)))
    try:
        forward = build(given, plate)
    except KeyError as error:
        raise RefusedError(
            Reason.DISTORTION_INCOMPLETE,
            f"camera {camera.name}: distortion {name} lacks the parameter {error.args[0]}.",
            "Add it to the camera file's [distortion] section, or choose another model.",
        ) from error
    except (ValueError, TypeError) as error:
        raise RefusedError(
            Reason.DISTORTION_INVALID,
            f"camera {camera.name}: distortion {name}: {error}.",
            "Correct the camera file's [distortion] section.",
        ) from error
    return OpticsModel(
        name=name,
        raw_size_px=camera.detector_size_px,
        size_px=camera.size_px,
        centre_px=camera.centre_px,
        pitch_mm=camera.pixel_pitch_mm or 1.0,
        plane=camera.focal_plane or _square(camera, tuple(given.get("raw_centre_px", camera.centre_px))),
        forward=forward,
        forward_is_distort=forward_is_distort,
    )


def _square(camera: Lens, origin_px: tuple[float, float]) -> FocalPlane:
    """An upright detector of square pixels; without a known pitch a millimetre stands for a pixel."""
    pitch = camera.pixel_pitch_mm or 1.0
    return FocalPlane(origin_px=origin_px, mm_from_px=((pitch, 0.0), (0.0, pitch)))


def is_plain(camera: Lens, name: str) -> bool:
    """Whether raw and undistorted frame are one."""
    return name == "none" and camera.focal_plane is None
