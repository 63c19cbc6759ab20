"""Distortion models of calibrated optics, as the missions, ISIS and USGS' CSM library state them.

Each is a map of the focal plane, millimetres from the boresight (..., 2), given in the direction in which it is
published; `DISTORTIONS` says which one. The inverse is Newton's (catalog/newton.py). Coefficients are those of the
instrument kernels and ISDs, unchanged. Formulas: ISIS' CameraDistortionMap and its children, USGSCSM's Distortion.cpp,
and the kernels' own text.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catalog.newton import PointMap, Points

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Plate:
    """What some models need beside their coefficients: the pixel pitch and the focal length, mm (None: unknown), and
    half the detector's diagonal in pixels."""

    pitch: float | None
    focal_length: float | None
    half_diagonal_px: float

    @property
    def pitch_mm(self) -> float:
        """The pixel pitch; KeyError where the camera does not state it."""
        if self.pitch is None:
            raise KeyError("pixel_pitch_mm")
        return self.pitch

    @property
    def focal_length_mm(self) -> float:
        """The focal length; KeyError where the camera does not state it."""
        if self.focal_length is None:
            raise KeyError("focal_length_mm")
        return self.focal_length


def radial(coefficients: ArrayLike, centre_mm: ArrayLike = (0.0, 0.0)) -> PointMap:
    """Undistorted of distorted: xu = xd (1 - k0 - k1 r^2 - k2 r^4 ...), r^2 = xd^2 + yd^2 (ISIS' OD_K; CSM's `radial`,
    and its `cahvor` about another centre)."""
    k, centre = _series(coefficients), np.asarray(centre_mm, dtype=np.float64)

    def forward(p: Points) -> Points:
        q = p - centre
        return q * (1.0 - _even(k, q)) + centre

    return forward


def radial_outward(coefficients: ArrayLike) -> PointMap:
    """Distorted of undistorted: xd = xu (1 + k0 + k1 r^2 + k2 r^4 ...), r^2 = xu^2 + yu^2 (Dawn FC, JunoCam)."""
    k = _series(coefficients)
    return lambda p: p * (1.0 + _even(k, p))


def radial_decentered(coefficients: ArrayLike, decentering: ArrayLike, centre_mm: ArrayLike) -> PointMap:
    """Undistorted of distorted, about a principal point: xu = xd + x dr + p1 (r^2 + 2 x^2) + 2 p2 x y, and the same for
    y with p1 and p2 exchanged; dr = k0 + k1 r^2 + k2 r^4 (Clementine UVVIS: OD_K, DECENTER, PP)."""
    k, (p1, p2) = _series(coefficients), np.asarray(decentering, dtype=np.float64)
    centre = np.asarray(centre_mm, dtype=np.float64)

    def forward(p: Points) -> Points:
        q = p - centre
        x, y, r2 = q[..., 0], q[..., 1], (q**2).sum(axis=-1)
        tangential = [p1 * (r2 + 2 * x * x) + 2 * p2 * x * y, 2 * p1 * x * y + p2 * (r2 + 2 * y * y)]
        return p + q * _even(k, q) + np.stack(tangential, axis=-1)

    return forward


def radial_all_powers(coefficients: ArrayLike, centre_mm: ArrayLike) -> PointMap:
    """Distorted of undistorted about a centre: xd = xu + (xu - x0)(k0 + k1 r + k2 r^2 + k3 r^3 ...) (OSIRIS-REx
    OCAMS: OD_K, OD_CENTER)."""
    k, centre = _series(coefficients), np.asarray(centre_mm, dtype=np.float64)

    def forward(p: Points) -> Points:
        q = p - centre
        return p + q * np.polynomial.polynomial.polyval(np.hypot(q[..., 0], q[..., 1]), k)[..., None]

    return forward


def transverse(x: Sequence[float], y: Sequence[float]) -> PointMap:
    """Distorted of undistorted: two cubic polynomials with the terms 1, x, y, x^2, xy, y^2, x^3, x^2 y, x y^2, y^3
    (MESSENGER MDIS' OD_T_X, OD_T_Y; CSM's `transverse`)."""
    rows = np.array([_exactly(x, 10, "x"), _exactly(y, 10, "y")])

    def forward(p: Points) -> Points:
        u, v = p[..., 0], p[..., 1]
        terms = [np.ones_like(u), u, v, u * u, u * v, v * v, u**3, u * u * v, u * v * v, v**3]
        return np.stack(terms, axis=-1) @ rows.T

    return forward


def rational(a1: Sequence[float], a2: Sequence[float], a3: Sequence[float]) -> PointMap:
    """Undistorted of distorted: x = a1.c / a3.c, y = a2.c / a3.c with c = (x^2, x y, y^2, x, y, 1) (TGO CaSSIS'
    OD_A1_CORR to OD_A3_CORR)."""
    rows = np.array([_exactly(a, 6, name) for name, a in (("a1", a1), ("a2", a2), ("a3", a3))])

    def forward(p: Points) -> Points:
        x, y = p[..., 0], p[..., 1]
        values = np.stack([x * x, x * y, y * y, x, y, np.ones_like(x)], axis=-1) @ rows.T
        return values[..., :2] / values[..., 2:]

    return forward


def radial_tangential(
    coefficients: Sequence[float],
    focal_length_mm: float,
    raw_focal_length_mm: Sequence[float] | None = None,
    centre_mm: ArrayLike = (0.0, 0.0),
) -> PointMap:
    """Distorted of undistorted after Brown and Conrady, in tangents of angles: OpenCV's k1, k2, p1, p2, k3, and in the
    denominator k4, k5, k6 (CSM's `radtan`; OSIRIS-REx TAGCAMS' OPENCV_OD_*).

    raw_focal_length_mm: of the distorted side in x and y, where it is calibrated for itself. centre_mm: where the axis
    is on the distorted side; the undistorted one is counted from there.
    """
    k1, k2, p1, p2, k3, k4, k5, k6 = (*map(float, coefficients), *[0.0] * (8 - len(coefficients)))
    raw = np.asarray(raw_focal_length_mm or (focal_length_mm, focal_length_mm), dtype=np.float64)
    centre = np.asarray(centre_mm, dtype=np.float64)

    def forward(p: Points) -> Points:
        x, y = (p[..., axis] / focal_length_mm for axis in range(2))
        r2 = x * x + y * y
        scale = (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)))
        bent = [x * scale + 2 * p1 * x * y + p2 * (r2 + 2 * x * x), y * scale + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y]
        return np.stack(bent, axis=-1) * raw + centre

    return forward


def legendre(x: Sequence[float], y: Sequence[float], half_mm: ArrayLike) -> PointMap:
    """Undistorted of distorted by 20 products of Legendre polynomials, up to the fifth order, in each direction, of
    coordinates that run from -1 to +1 over the detector and grow against the focal plane's axes (New Horizons MVIC's
    DISTORTION_COEF_X, _Y)."""
    half = np.asarray(half_mm, dtype=np.float64)
    tables = np.zeros((2, 6, 6))
    order = [(i, n - i) for n in range(1, 6) for i in range(n + 1)]
    for table, values in zip(tables, (x, y), strict=True):
        for (i, j), value in zip(order, _exactly(values, 20, "x or y"), strict=True):
            table[i, j] = value

    def forward(p: Points) -> Points:
        scaled = -p / half
        shift = [np.polynomial.legendre.legval2d(scaled[..., 0], scaled[..., 1], table) for table in tables]
        return -(scaled + np.stack(shift, axis=-1)) * half

    return forward


def owen_oconnell(em: Sequence[float], y_up: bool) -> PointMap:
    """Distorted of undistorted after Owen and O'Connell: d(X, Y) = (X, Y) (R^2 EM2 + Y EM5 + X EM6).

    em: (EM2 per mm^2, EM5 per mm, EM6 per mm), as nh_lorri_v201.ti gives them for rows that grow upwards (the order
    of the FITS file; its SIP keywords AP_3_0, AP_1_1, AP_2_0 are the same three numbers in pixels). y_up: our rows
    grow upwards too; otherwise Y changes sign.
    """
    em2, em5, em6 = _exactly(em, 3, "em")
    sign = 1.0 if y_up else -1.0

    def forward(p: Points) -> Points:
        x, y = p[..., :1], p[..., 1:] * sign
        return p * (1.0 + (x**2 + y**2) * em2 + y * em5 + x * em6)

    return forward


def power_shift(corner_shift_px: float, corner_px: float, power: float) -> PointMap:
    """Distorted of undistorted: every point moves outward by corner_shift_px * (d / corner_px) ** power.

    With power 3 and 1.2 px at the corner this is the paper's equation 1 and VICAR's GLLGCOR (6.58e-9 d^3 = 1.19 px).
    The paper calls (x, y) raw and (x_d, y_d) undistorted, which would be barrel; SSI's distortion is pincushion
    (VICAR and ISIS agree): the raw point is the outer one, so equation 1 is the map that resampling looks up.
    """

    def forward(p: Points) -> Points:
        distance = np.hypot(p[..., 0], p[..., 1])[..., None]
        return p * (1.0 + corner_shift_px / corner_px * (distance / corner_px) ** (power - 1.0))

    return forward


def _series(coefficients: ArrayLike) -> Array:
    k = np.atleast_1d(np.asarray(coefficients, dtype=np.float64))
    if k.ndim != 1 or not k.size or not np.isfinite(k).all():
        raise ValueError(f"coefficients must be finite numbers, got {np.asarray(coefficients).tolist()}")
    return k


def _even(k: Array, p: Points) -> Array:
    """k0 + k1 r^2 + k2 r^4 ... (..., 1)."""
    return np.polynomial.polynomial.polyval((p**2).sum(axis=-1), k)[..., None]


def _exactly(values: Sequence[float], count: int, name: str) -> list[float]:
    if len(values) != count:
        raise ValueError(f"{name} must have {count} numbers, has {len(values)}")
    return [float(value) for value in values]


def _in_pixels(function: PointMap, pitch: float) -> PointMap:
    """A map of pixels as one of millimetres."""
    return lambda p: function(p / pitch) * pitch


Build = Callable[[Mapping[str, Any], Plate], PointMap]


def _power(power: float) -> Build:
    def build(given: Mapping[str, Any], plate: Plate) -> PointMap:
        corner_px = float(given.get("corner_px", plate.half_diagonal_px))
        return _in_pixels(power_shift(float(given["corner_shift_px"]), corner_px, power), plate.pitch or 1.0)

    return build


def _k1(given: Mapping[str, Any], plate: Plate) -> PointMap:
    """xu = xd (1 + K1 r^2), r in mm (ISIS' RadialDistortionMap; K1 < 0 for Galileo SSI)."""
    return _of_millimetres(radial((0.0, -float(given["k1_per_mm2"]))), plate)


def _em(given: Mapping[str, Any], plate: Plate) -> PointMap:
    return _of_millimetres(owen_oconnell(given["em"], bool(given["y_up"])), plate)


def _of_millimetres(function: PointMap, plate: Plate) -> PointMap:
    """The map; KeyError where no pixel pitch tells how long a millimetre is."""
    plate.pitch_mm  # noqa: B018
    return function


def _radtan(given: Mapping[str, Any], plate: Plate) -> PointMap:
    known = {key: given[key] for key in ("raw_focal_length_mm", "centre_mm") if key in given}
    return radial_tangential(given["coefficients"], plate.focal_length_mm, **known)


def _by(function: Callable[..., PointMap], *needed: str, **usual: Any) -> Build:
    """A model whose parameters are given by name in the camera file."""

    def build(given: Mapping[str, Any], _: Plate) -> PointMap:
        return function(*(given[key] for key in needed), *(given.get(key, value) for key, value in usual.items()))

    return build


def undistorted() -> PointMap:
    """No distortion."""
    return lambda p: p


MIDDLE = (0.0, 0.0)
# Model: how it is built from the camera file's [distortion], and whether it leads from undistorted to distorted.
DISTORTIONS: dict[str, tuple[Build, bool]] = {
    "none": (_by(undistorted), False),
    "ssi-cubic": (_power(3.0), True),
    "ssi-quadratic": (_power(2.0), True),
    "radial-k1": (_k1, False),
    "lorri-em": (_em, True),
    "radial-series": (_by(radial, "coefficients", centre_mm=MIDDLE), False),
    "radial-outward": (_by(radial_outward, "coefficients"), True),
    "radial-decentered": (_by(radial_decentered, "coefficients", "decentering", centre_mm=MIDDLE), False),
    "radial-all-powers": (_by(radial_all_powers, "coefficients", "centre_mm"), True),
    "transverse": (_by(transverse, "x", "y"), True),
    "rational": (_by(rational, "a1", "a2", "a3"), False),
    "radial-tangential": (_radtan, True),
    "legendre": (_by(legendre, "x", "y", "half_mm"), False),
}
