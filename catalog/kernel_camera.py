"""A camera from instrument kernels: IK, frame kernels and ISIS' instrument addenda.

Conventions of the keywords: BORESIGHT_SAMPLE, _LINE (ISIS) count the first pixel as 1, except where the value is the
middle of the detector counted from 0 (Hayabusa AMICA); CCD_CENTER, CENTER and FOV_CENTER_PIXEL (NAIF) count it as 0,
except where the value is the middle counted from 1 (Cassini ISS, MESSENGER MDIS). TRANSX and
TRANSY lead from pixels beyond the boresight to millimetres of the focal plane. Lengths are millimetres unless _UNITS
says otherwise, or the field of view shows that they are metres (or a pixel's micrometres).
"""

import math
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.errors import RefusedError
from catalog.focal_plane import axes_of
from catalog.instrument_kernel import INSTRUMENT_REMEDY, Instrument, KernelPool, instrument_name, naif_id_of
from catalog.kernel_distortion import COVER_REMOVED_ET, Detector, distortion_of, keywords_left_out
from catalog.kernel_frames import Frames, frames_of
from catalog.reasons import Reason
from catalog.spice import kernel_pool

Array = NDArray[np.float64]
UNIT_MM = {"mm": 1.0, "millimeters": 1.0, "m": 1e3, "meters": 1e3, "cm": 10.0}
NEAR_MIDDLE_PX = 0.25
SAME_PITCH = 5e-5  # 0.03 px at the edge of a frame of 1024 pixels
NEARLY_SQUARE = 1.01  # pixels whose sides differ by less (Dawn FC: 1.0006) make an undistorted frame of the same size
CENTRES = ("CCD_CENTER", "CENTER", "FOV_CENTER_PIXEL")
SIZES = (("FILTER", True), ("PIXEL", False), ("FRAME", False))
SMALLEST_FOCAL_LENGTH_MM = 1.0  # a smaller number is metres: no spacecraft camera is shorter than a millimetre
PITCHES_MM = (1e-3, 0.2)  # pixels are 1 to 200 micrometres; other numbers are micrometres or metres
FILTER_SUFFIXES = ("_FILTER_{}", "_FILTER{}", "_{}")


def content_from_kernels(
    kernels: Iterable[Path],
    instrument: str | int,
    et: float | None = None,
    filter_name: str | None = None,
    temperature_c: float | None = None,
    size_px: tuple[int, int] | None = None,
) -> dict[str, Any]:
    """Content of a camera file for a NAIF instrument name or id; see `catalog.camera.Camera.from_kernels`."""
    with kernel_pool(kernels) as loaded:
        naif_id = _of_filter(naif_id_of(instrument), filter_name)
        kernel = Instrument(naif_id, instrument_name(naif_id), KernelPool(loaded))
        return content_of(kernel, frames_of(kernel), et, filter_name, temperature_c, size_px)


def as_keyword(name: str) -> str:
    """A filter's name as kernel keywords spell it: CL1/UV3 as CL1_UV3."""
    return re.sub(r"[^A-Z0-9]+", "_", name.upper()).strip("_")


def _of_filter(naif_id: int, filter_name: str | None) -> int:
    """Id of the camera with the filter, where kernels name one (DAWN_FC2_FILTER_3, JUNO_JUNOCAM_METHANE)."""
    import spiceypy

    if filter_name is None:
        return naif_id
    for suffix in FILTER_SUFFIXES:
        try:
            return int(spiceypy.bods2c(instrument_name(naif_id) + suffix.format(as_keyword(filter_name))))
        except spiceypy.NotFoundError:
            continue
    return naif_id


def content_of(
    kernel: Instrument,
    frames: Frames,
    et: float | None = None,
    filter_name: str | None = None,
    temperature_c: float | None = None,
    size_px: tuple[int, int] | None = None,
) -> dict[str, Any]:
    """Content of a camera file for an instrument's keywords and frames. Raises RefusedError naming what is missing."""
    filter_name = as_keyword(filter_name) if filter_name else None
    full, first_px = _size_and_start(kernel, size_px)
    _refuse_scanner(kernel, full)
    focal_length, by_temperature = _focal_length(kernel, et, filter_name, temperature_c)
    mm_from_px, offset = _affine(kernel)
    origin, base = _origin(kernel, size_px or _size(kernel) or full)
    detector = Detector(mm_from_px, origin - first_px, full, focal_length, base)
    distortion = distortion_of(kernel, detector, et, filter_name, temperature_c)
    left_out = keywords_left_out(kernel)
    content = undistorted_frame(mm_from_px, offset, detector.origin_px, full, frames.handedness)
    filters = {} if filter_name else _filters(kernel, focal_length)
    content |= {
        "name": _camera_name(kernel.name),
        "title": f"{kernel.name} from kernels" + (f", filter {filter_name}" if filter_name else ""),
        "focal_length_mm": focal_length,
        "distortion": distortion,
        "naif_instrument_id": kernel.naif_id,
        **({"focal_length_mm_by_temperature": by_temperature} if by_temperature else {}),
        **({"filters": filters} if filters else {}),
        **frames.content(),
        "sources": (
            *kernel.sources(),
            *_other_pitches(kernel, np.hypot(*mm_from_px)),
            *(f"not used: {keyword}" for keyword in left_out),
        ),
        "tried": "made from kernels; not tried on images by this program",
    }
    sigma = kernel.number("FL_UNCERTAINTY")
    if sigma is not None and 0 < sigma < 0.1 * focal_length:
        content["focal_length_sigma"] = sigma / focal_length
    return content


def undistorted_frame(
    mm_from_px: Array, offset_mm: Array, origin_px: Array, size_px: tuple[int, int], handedness: int
) -> dict[str, Any]:
    """Fields of a camera file that place the undistorted frame: square pixels (of the smaller side where the detector's
    are oblong), the boresight where it is on the detector, lines running down; and the focal plane."""
    sides = np.hypot(*mm_from_px)
    nearly_square = sides.max() < NEARLY_SQUARE * sides.min()
    pitch = float(np.sqrt(sides.prod()) if nearly_square else sides.min())
    axes = axes_of(mm_from_px, handedness)
    along = np.array(axes, dtype=float) @ mm_from_px
    if abs(along[0, 1]) > abs(along[0, 0]):
        sides = sides[::-1]
    scale = sides / pitch
    size = tuple(size_px) if nearly_square else tuple(math.ceil(n * s) for n, s in zip(size_px, scale, strict=True))
    centre = (origin_px + 0.5) * scale - 0.5
    mirrored = along[1, 1] < 0
    centre = np.array([centre[0], size[1] - 1 - centre[1]]) if mirrored else centre
    content: dict[str, Any] = {
        "size_px": size,
        "raw_size_px": tuple(size_px),
        "centre_px": tuple(map(float, centre)),
        "pixel_pitch_mm": pitch,
        "focal_plane": {
            "origin_px": tuple(map(float, origin_px)),
            "mm_from_px": tuple(tuple(map(float, row)) for row in mm_from_px),
            "offset_mm": tuple(map(float, offset_mm)),
            "axes": axes,
        },
        "camera_from_instrument": ((*axes[0], 0.0), (*axes[1], 0.0), (0.0, 0.0, float(handedness))),
    }
    return content


def _camera_name(name: str) -> str:
    return re.sub(r"[^A-Za-z0-9.]+", "-", name.lower()).strip("-.") or "camera"


def _size(kernel: Instrument) -> tuple[int, int] | None:
    """Samples and lines of the whole detector."""
    for word, own in SIZES[1:]:
        samples, lines = kernel.number(f"{word}_SAMPLES", own), kernel.number(f"{word}_LINES", own)
        if samples and lines:
            return round(samples), round(lines)
    samples, lines = kernel.number("S_MAX"), kernel.number("L_MAX")
    return (round(samples), round(lines)) if samples and lines else None


def _size_and_start(kernel: Instrument, given: tuple[int, int] | None) -> tuple[tuple[int, int], Array]:
    """Size of the frame, and the 0-based detector pixel that it begins with: a framelet's lines under a filter are a
    part of the detector (FILTER_LINES, with FILTER_OFFSET or a boresight line of the filter's own)."""
    samples, lines = (kernel.number(f"FILTER_{word}", own=True) for word in ("SAMPLES", "LINES"))
    start = np.zeros(2)
    if given is None and samples and lines:
        offset = kernel.number("FILTER_OFFSET", own=True)
        own_line = kernel.number("BORESIGHT_LINE", own=True)
        parent = kernel.parent.number("BORESIGHT_LINE", own=True) if kernel.parent else None
        if offset is not None:
            start[1] = offset - 1.0
        elif own_line is not None and parent is not None:
            start[1] = own_line - 0.5 * (lines - 1) - 1.0
        return (round(samples), round(lines)), start
    size = given or _size(kernel)
    if size is None:
        raise RefusedError(
            Reason.INSTRUMENT_INCOMPLETE,
            kernel.fault("no loaded kernel says how many pixels it has (PIXEL_SAMPLES, PIXEL_LINES)"),
            "Load the instrument kernel that does, or give the frame's size (size_px of Camera.from_kernels).",
        )
    return size, start


def _refuse_scanner(kernel: Instrument, size: tuple[int, int]) -> None:
    keywords = kernel.keywords()
    if min(size) == 1 or "RESIDUAL_COL_DIST_COEF" in keywords or any("TDI" in keyword for keyword in keywords):
        what = f"it is a line scanner ({size[0]}x{size[1]} pixels): each of its lines has another time and another pose"
        remedy = "Give an image of a frame camera, or one framelet of a push-frame camera."
        raise RefusedError(Reason.LINE_SCANNER, kernel.fault(what), remedy)


def _focal_length(
    kernel: Instrument, et: float | None, filter_name: str | None, temperature_c: float | None
) -> tuple[float, tuple[float, ...]]:
    """Focal length in mm, and its polynomial in degrees Celsius if the kernel has one and no temperature is given."""
    by_temperature = kernel.numbers("FL_TEMP_COEFFS")
    if by_temperature and temperature_c is not None:
        return float(np.polynomial.polynomial.polyval(temperature_c, by_temperature)), ()
    of_filter = kernel.number(f"{filter_name}_FOCAL_LENGTH") if filter_name else None
    covered = kernel.number("FOCAL_LENGTH_COVER") if et is not None and et < COVER_REMOVED_ET else None
    stated = (of_filter, covered, kernel.number("FOCAL_LENGTH"), kernel.number("OOC_FOCAL_LENGTH"))
    value = next((each for each in stated if each is not None), None)
    if value is None or not value > 0:
        fault = kernel.fault("no loaded kernel gives its focal length (FOCAL_LENGTH)")
        raise RefusedError(Reason.INSTRUMENT_INCOMPLETE, fault, INSTRUMENT_REMEDY)
    unit = (kernel.text("FOCAL_LENGTH_UNITS") or "").lower()
    scale = UNIT_MM.get(unit, 1e3 if value < SMALLEST_FOCAL_LENGTH_MM else 1.0)
    return value * scale, tuple(coefficient * scale for coefficient in by_temperature)


def _filters(kernel: Instrument, focal_length: float) -> dict[str, dict[str, float]]:
    """What each filter changes of the camera: INS<id>_<filter>_FOCAL_LENGTH."""
    ending = "_FOCAL_LENGTH"
    names = [k.removesuffix(ending) for k in kernel.keywords() if k.endswith(ending) and k != f"DEFAULT{ending}"]
    lengths = {name: kernel.number(f"{name}{ending}") for name in names if name and name != "OOC"}
    return {name: {"focal_length_mm": value} for name, value in lengths.items() if value and value != focal_length}


def _affine(kernel: Instrument) -> tuple[Array, Array]:
    """mm_from_px (2, 2) and the constants of TRANSX and TRANSY; square pixels of the pitch without them."""
    rows = [kernel.numbers("TRANSX"), kernel.numbers("TRANSY")]
    if all(len(row) == 3 for row in rows):
        _refuse_flat(kernel, "TRANSX and TRANSY", rows)
        return np.array([row[1:] for row in rows]), np.array([row[0] for row in rows])
    inverse = [kernel.numbers("ITRANSS"), kernel.numbers("ITRANSL")]
    if all(len(row) == 3 for row in inverse):
        _refuse_flat(kernel, "ITRANSS and ITRANSL", inverse)
        matrix = np.linalg.inv(np.array([row[1:] for row in inverse]))
        return matrix, -matrix @ np.array([row[0] for row in inverse])
    return np.diag(_pitches(kernel)), np.zeros(2)


def _refuse_flat(kernel: Instrument, keywords: str, rows: list[tuple[float, ...]]) -> None:
    """Refuse an affine map that has no inverse: it puts all pixels on one line."""
    determinant = float(np.linalg.det(np.array([row[1:] for row in rows])))
    if not math.isfinite(determinant) or determinant == 0.0:
        fault = kernel.fault(f"its {keywords} map all pixels onto one line")
        raise RefusedError(Reason.INSTRUMENT_INCOMPLETE, fault, INSTRUMENT_REMEDY)


def _pitches(kernel: Instrument) -> Array:
    """Width and height of a pixel in mm."""
    kmat = kernel.numbers("OOC_KMAT")
    if len(kmat) == 4:
        return 1.0 / np.array([kmat[0], kmat[3]])
    for keyword in ("PIXEL_PITCH", "PIXEL_SIZE"):
        values = kernel.numbers(keyword)
        if values and min(values) > 0 and math.isfinite(max(values)):
            sides = np.array([values[0], values[-1]])
            scale = next((s for s in (1.0, 1e-3, 1e3) if PITCHES_MM[0] <= sides[0] * s <= PITCHES_MM[1]), 1.0)
            return sides * scale
    fault = kernel.fault("no loaded kernel gives its pixels' size (PIXEL_PITCH or TRANSX)")
    raise RefusedError(Reason.INSTRUMENT_INCOMPLETE, fault, INSTRUMENT_REMEDY)


def _other_pitches(kernel: Instrument, sides: Array) -> list[str]:
    """What OOC_KMAT or PIXEL_SIZE say otherwise than the affine of the focal plane, which counts."""
    found = []
    for keyword in ("OOC_KMAT", "PIXEL_SIZE"):
        values = kernel.pool.numbers(f"INS{kernel.naif_id}_{keyword}")
        if not values or min(values[0], values[-1]) <= 0:
            continue
        other = np.array([values[0], values[-1]])
        other = 1.0 / other if keyword == "OOC_KMAT" else other
        scale = next((s for s in (1.0, 1e-3, 1e3) if PITCHES_MM[0] <= other[0] * s <= PITCHES_MM[1]), 1.0)
        if np.abs(other * scale / sides - 1).max() > SAME_PITCH:
            used, there = (" x ".join(f"{side:.7g}" for side in each) for each in (sides, other * scale))
            found.append(f"contradiction: pixels of {used} mm are used, {keyword} has {there} mm")
    return found


def _origin(kernel: Instrument, size: tuple[int, int]) -> tuple[Array, float]:
    """0-based detector pixel of the boresight, and the number of the first pixel in the kernels' counting."""
    source = kernel.parent or kernel
    sample, line = source.number("BORESIGHT_SAMPLE"), source.number("BORESIGHT_LINE")
    from_zero = np.array(size) / 2.0 - 0.5  # the middle, counted from 0
    if sample is not None and line is not None:
        pixel = np.array([sample, line])
        base = 0.0 if (pixel == from_zero).all() else 1.0
        return pixel - base, base
    for keyword in CENTRES:
        values = kernel.numbers(keyword)
        if len(values) >= 2:
            pixel = np.array(values[:2])
            base = 1.0 if np.abs(pixel - from_zero - 1.0).max() < NEAR_MIDDLE_PX else 0.0
            return pixel - base, base
    return from_zero, 1.0
