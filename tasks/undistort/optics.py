"""Distortion models of cameras whose optics were calibrated once: Galileo SSI and New Horizons LORRI."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catalog.camera import Camera
from catalog.errors import RefusedError
from catalog.reasons import Reason
from tasks.undistort.model import Identity, PointMap, Points, solve_points


@dataclass(frozen=True)
class OpticsModel:
    """A smooth map about the optical axis, given in one direction and inverted by Newton's method.

    forward: offsets from the axis (n, 2) in pixels to offsets on the other side; forward_is_distort tells whether it
    leads from undistorted to raw. centre_px: the axis in the undistorted frame, raw_centre_px in the raw one.
    """

    name: str
    raw_size_px: tuple[int, int]
    size_px: tuple[int, int]
    centre_px: tuple[float, float]
    raw_centre_px: tuple[float, float]
    forward: PointMap
    forward_is_distort: bool

    def undistort_points(self, xy_raw: ArrayLike) -> Points:
        """Undistorted places (..., 2) of raw pixels (..., 2)."""
        offset = np.asarray(xy_raw, dtype=np.float64) - self.raw_centre_px
        return self._mapped(offset, inverse=self.forward_is_distort) + self.centre_px

    def distort_points(self, xy: ArrayLike) -> Points:
        """Raw places (..., 2) of undistorted pixels (..., 2)."""
        offset = np.asarray(xy, dtype=np.float64) - self.centre_px
        return self._mapped(offset, inverse=not self.forward_is_distort) + self.raw_centre_px

    def _mapped(self, offset: Points, inverse: bool) -> Points:
        if inverse:
            return solve_points(self.forward, offset, offset)
        return self.forward(offset.reshape(-1, 2)).reshape(offset.shape)

    def extrapolated(self, xy: ArrayLike) -> NDArray[np.bool_]:
        """False everywhere: the formula holds for the whole frame."""
        return np.zeros(np.shape(xy)[:-1], dtype=bool)

    def uncertainty_px(self, xy: ArrayLike) -> NDArray[np.float64]:
        """Zero: the calibrations state no error of the distortion."""
        return np.zeros(np.shape(xy)[:-1])


def power_shift(corner_shift_px: float, corner_px: float, power: float) -> PointMap:
    """Raw offsets of undistorted ones: every point moves outward by corner_shift_px * (d / corner_px) ** power.

    With power 3 and 1.2 px at the corner this is the paper's equation 1 and VICAR's GLLGCOR (6.58e-9 d^3 = 1.19 px).
    The paper calls (x, y) raw and (x_d, y_d) undistorted, which would be barrel; SSI's distortion is pincushion
    (VICAR and ISIS agree): the raw point is the outer one, so equation 1 is the map that resampling looks up.
    """

    def forward(offset: Points) -> Points:
        distance = np.hypot(offset[..., 0], offset[..., 1])[..., None]
        return offset * (1.0 + corner_shift_px / corner_px * (distance / corner_px) ** (power - 1.0))

    return forward


def radial_k1(k1_per_mm2: float, pitch_mm: float) -> PointMap:
    """Undistorted offsets of raw ones: xu = xd (1 + K1 r^2), r in mm (ISIS RadialDistortionMap; K1 < 0 for SSI)."""

    def forward(offset: Points) -> Points:
        r2_mm2 = (offset**2).sum(axis=-1, keepdims=True) * pitch_mm**2
        return offset * (1.0 + k1_per_mm2 * r2_mm2)

    return forward


def owen_oconnell(em: tuple[float, float, float], pitch_mm: float, y_up: bool) -> PointMap:
    """Raw offsets of undistorted ones after Owen and O'Connell: d(X, Y) = (X, Y) (R^2 EM2 + Y EM5 + X EM6), in mm.

    em: (EM2 per mm^2, EM5 per mm, EM6 per mm), as nh_lorri_v201.ti gives them for rows that grow upwards (the order
    of the FITS file; its SIP keywords AP_3_0, AP_1_1, AP_2_0 are the same three numbers in pixels). y_up: our rows
    grow upwards too; otherwise Y changes sign.
    """
    em2, em5, em6 = em
    sign = 1.0 if y_up else -1.0

    def forward(offset: Points) -> Points:
        x_mm, y_mm = offset[..., :1] * pitch_mm, offset[..., 1:] * pitch_mm * sign
        return offset * (1.0 + (x_mm**2 + y_mm**2) * em2 + y_mm * em5 + x_mm * em6)

    return forward


def optics_model(name: str, camera: Camera, parameters: dict[str, Any]) -> OpticsModel | Identity:
    """The model `name` of `camera`; parameters as in the camera file's [distortion].

    none; ssi-cubic, ssi-quadratic (corner_shift_px, corner_px); radial-k1 (k1_per_mm2); lorri-em (em, y_up).
    Raises RefusedError for unknown names and missing parameters.
    """
    if name == "none":
        return Identity(camera.size_px)
    if name not in _FORWARD:
        raise RefusedError(
            Reason.DISTORTION_UNKNOWN,
            f"camera {camera.name} names the distortion model {name!r}.",
            f"Known are {', '.join(OPTICS_NAMES)} and reseau.",
        )
    try:
        forward, is_distort = _FORWARD[name](camera, parameters)
    except KeyError as error:
        raise RefusedError(
            Reason.DISTORTION_INCOMPLETE,
            f"camera {camera.name}: distortion {name} lacks the parameter {error.args[0]}.",
            "Add it to the camera file's [distortion] section, or choose another model.",
        ) from error
    raw_centre = tuple(parameters.get("raw_centre_px", camera.centre_px))
    raw_size = camera.detector_size_px
    return OpticsModel(name, raw_size, camera.size_px, camera.centre_px, raw_centre, forward, is_distort)


def _pitch_mm(camera: Camera) -> float:
    if camera.pixel_pitch_mm is None:
        raise KeyError("pixel_pitch_mm")
    return camera.pixel_pitch_mm


def _power(power: float) -> Callable[[Camera, dict[str, Any]], tuple[PointMap, bool]]:
    def build(camera: Camera, parameters: dict[str, Any]) -> tuple[PointMap, bool]:
        half_diagonal = 0.5 * float(np.hypot(*camera.detector_size_px))
        corner_px = float(parameters.get("corner_px", half_diagonal))
        return power_shift(float(parameters["corner_shift_px"]), corner_px, power), True

    return build


def _k1(camera: Camera, parameters: dict[str, Any]) -> tuple[PointMap, bool]:
    return radial_k1(float(parameters["k1_per_mm2"]), _pitch_mm(camera)), False


def _em(camera: Camera, parameters: dict[str, Any]) -> tuple[PointMap, bool]:
    em2, em5, em6 = (float(value) for value in parameters["em"])
    return owen_oconnell((em2, em5, em6), _pitch_mm(camera), bool(parameters["y_up"])), True


_FORWARD: dict[str, Callable[[Camera, dict[str, Any]], tuple[PointMap, bool]]] = {
    "ssi-cubic": _power(3.0),
    "ssi-quadratic": _power(2.0),
    "radial-k1": _k1,
    "lorri-em": _em,
}
OPTICS_NAMES = ("none", *_FORWARD)
