"""The distortion model that an instrument's kernel keywords stand for; formulas in `catalog.distortions`."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.instrument_kernel import Instrument

Array = NDArray[np.float64]
Model = dict[str, Any]
COVER_REMOVED_ET = -181569600.0  # 1994-04-01T00:00 UTC, to a minute: Galileo SSI's dust cover
MULTIPLIER = (0.5, 1.5)  # an OD_K whose first number is about 1 multiplies, those about 0 are added to 1
UNUSED_WORDS = ("OD_", "DISTORTION", "DIST_COEF", "_K1", "K1_", "K2_")


@dataclass(frozen=True)
class Detector:
    """What distortion keywords refer to: mm = mm_from_px (xy - origin_px); size (x, y) in pixels; focal length in mm;
    pixel_base: number of the first pixel in the kernels' counting (0 or 1)."""

    mm_from_px: Array
    origin_px: Array
    size_px: tuple[int, int]
    focal_length_mm: float
    pixel_base: float

    @property
    def pitch_mm(self) -> float:
        """Geometric mean of the pixel's sides."""
        return float(abs(np.linalg.det(self.mm_from_px)) ** 0.5)

    def mm(self, xy_px: Array) -> Array:
        """Place in the focal plane (2,) of a 0-based pixel."""
        return self.mm_from_px @ (xy_px - self.origin_px)


def distortion_of(
    kernel: Instrument, detector: Detector, et: float | None, filter_name: str | None, temperature_c: float | None
) -> Model:
    """Content of [distortion] for a camera file: the model's name and its parameters; `none` where no keyword speaks of
    distortion."""
    suffix = f"_{filter_name}" if filter_name and kernel.numbers(f"OD_K_{filter_name}") else ""
    for rule in _RULES:
        model = rule(kernel, detector, suffix, et, temperature_c)
        if model is not None:
            return {key: _plain(value) for key, value in model.items()}
    return {"model": "none"}


def _plain(value: Any) -> Any:
    return np.asarray(value).tolist() if isinstance(value, tuple | list | np.ndarray) else value


Rule = Callable[[Instrument, Detector, str, float | None, float | None], Model | None]


def _transverse(kernel: Instrument, *_: Any) -> Model | None:
    x, y = kernel.numbers("OD_T_X"), kernel.numbers("OD_T_Y")
    return {"model": "transverse", "x": x, "y": y} if x and y else None


def _rational(kernel: Instrument, *_: Any) -> Model | None:
    rows = [kernel.numbers(f"OD_A{number}_CORR") for number in (1, 2, 3)]
    return {"model": "rational", "a1": rows[0], "a2": rows[1], "a3": rows[2]} if all(rows) else None


def _opencv(kernel: Instrument, detector: Detector, _: str, __: float | None, temperature_c: float | None) -> Any:
    """OSIRIS-REx TAGCAMS and OCAMS: OPENCV_OD_K (k1, k2, k3, k4, k5, k6), _P (p1, p2), _F and _C in pixels, _A the
    relative growth of the focal length per degree (ISIS' OsirisRexTagcamsDistortionMap)."""
    model = (kernel.text("DISTORTION_MODEL") or "").upper()
    k, p, f, c = (kernel.numbers(f"OPENCV_OD_{letter}") for letter in "KPFC")
    if model not in ("", "OPENCV") or not (k and p and f and c):
        return None
    growth = 1.0 + (kernel.number("OPENCV_OD_A") or 0.0) * (temperature_c or 0.0)
    turn = np.rint(detector.mm_from_px / detector.pitch_mm)  # pixels' axes in those of the focal plane
    p2, p1 = turn @ np.array([p[1], p[0]])  # (p2, p1) transforms as a vector
    focal = np.abs(turn @ np.array(f)) * detector.pitch_mm * growth
    k1, k2, k3, k4, k5, k6 = (*k, *[0.0] * (6 - len(k)))
    return {
        "model": "radial-tangential",
        "coefficients": (k1, k2, p1, p2, k3, k4, k5, k6),
        "raw_focal_length_mm": focal,
        "centre_mm": detector.mm(np.array(c) - 1.0),
    }


def _all_powers(kernel: Instrument, detector: Detector, suffix: str, *_: Any) -> Model | None:
    k, centre = kernel.numbers(f"OD_K{suffix}"), kernel.numbers(f"OD_CENTER{suffix}")
    if not (k and centre):
        return None
    centre_mm = detector.mm(np.array(centre) - detector.pixel_base)
    return {"model": "radial-all-powers", "coefficients": k, "centre_mm": centre_mm}


def _decentered(kernel: Instrument, *_: Any) -> Model | None:
    k, decentering = kernel.numbers("OD_K"), kernel.numbers("DECENTER")
    if not (k and decentering):
        return None
    centre = kernel.numbers("PP") or (0.0, 0.0)
    return {"model": "radial-decentered", "coefficients": k, "decentering": decentering, "centre_mm": centre}


def _radial(kernel: Instrument, detector: Detector, suffix: str, *_: Any) -> Model | None:
    """OD_K; Hayabusa2's, r' = r (L0 + L1 r^2 + L2 r^4) in pixels (Suzuki et al. 2018, Icarus 300, 341), begins with
    about 1."""
    k = kernel.numbers(f"OD_K{suffix}")
    if not k:
        return None
    if MULTIPLIER[0] < k[0] < MULTIPLIER[1]:
        k = (1.0 - k[0], *(-value / detector.pitch_mm ** (2 * power) for power, value in enumerate(k[1:], 1)))
    return {"model": "radial-series", "coefficients": k}


def _one_coefficient(kernel: Instrument, _: Detector, __: str, et: float | None, ___: float | None) -> Model | None:
    """K1 of ISIS' RadialDistortionMap, xu = xd (1 + K1 r^2): Galileo SSI, NEAR MSI, Cassini ISS."""
    covered = kernel.number("K1_COVER") if et is not None and et < COVER_REMOVED_ET else None
    k1 = kernel.number("K1") if covered is None else covered
    return None if k1 is None else {"model": "radial-series", "coefficients": (0.0, -k1)}


def _outward(kernel: Instrument, detector: Detector, *_: Any) -> Model | None:
    """Dawn FC's RAD_DIST_COEFF per mm^2; JunoCam's DISTORTION_K1, _K2 per px^2 and px^4."""
    per_mm2 = kernel.number("RAD_DIST_COEFF")
    if per_mm2 is not None:
        return {"model": "radial-outward", "coefficients": (0.0, per_mm2)}
    k = [kernel.number(f"DISTORTION_K{number}") for number in (0, 1, 2)]
    if k[1] is None:
        return None
    scaled = tuple((value or 0.0) / detector.pitch_mm ** (2 * power) for power, value in enumerate(k))
    return {"model": "radial-outward", "coefficients": scaled}


def _legendre(kernel: Instrument, detector: Detector, *_: Any) -> Model | None:
    x, y = kernel.numbers("DISTORTION_COEF_X"), kernel.numbers("DISTORTION_COEF_Y")
    if len(x) != 20 or len(y) != 20:
        return None
    return {"model": "legendre", "x": x, "y": y, "half_mm": 0.5 * detector.pitch_mm * np.array(detector.size_px)}


def _owen(kernel: Instrument, *_: Any) -> Model | None:
    em = kernel.numbers("OOC_EM")
    return {"model": "lorri-em", "em": em, "y_up": True} if len(em) == 3 else None


_RULES: tuple[Rule, ...] = (
    _transverse, _rational, _opencv, _all_powers, _decentered, _radial, _one_coefficient, _outward, _legendre, _owen,
)  # fmt: skip


def keywords_left_out(kernel: Instrument) -> list[str]:
    """Keywords of the instrument that speak of distortion and went into no model."""
    used = {
        variable.split("_", 1)[1] for variables in kernel.used.values() for variable in variables if "_" in variable
    }
    return [
        keyword
        for keyword in kernel.keywords()
        if any(word in f"_{keyword}" for word in UNUSED_WORDS) and keyword not in used
    ]
