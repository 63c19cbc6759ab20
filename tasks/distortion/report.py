"""What is known about the distortion of one image: all methods measured, figures, comparison with the archive."""

import time
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from catalog.camera import Camera, find_camera
from catalog.errors import RefusedError
from catalog.observation import Frame, Quality
from catalog.readers import read_frame
from catalog.reasons import Reason
from catalog.reseau.archive import read_archive_marks
from tasks.undistort import seen_marks, undistort
from tasks.undistort.bent_plate import BentModel
from tasks.undistort.choose import (
    SeenMarks,
    chosen_method,
    chosen_model,
    fitted_to_frame,
    table_of,
    uses_found_marks,
)
from tasks.undistort.compare import displacement_field, residual_model
from tasks.undistort.figures import (
    comparison_figure,
    displacement_figure,
    distortion_map_figure,
    marks_figure,
    residuals_figure,
    uncertainty_figure,
)
from tasks.undistort.frame_map import uncertainty_plane
from tasks.undistort.mark_set import MarkSet, marks_of_frame, marks_of_table
from tasks.undistort.methods import BENDING, METHODS, OF_A_FRAME, fit_model
from tasks.undistort.model import DistortionModel
from tasks.undistort.optics import OPTICS_NAMES
from tasks.undistort.polynomial import monomial_condition_number
from tasks.undistort.radial import radial_rmsd_from_corner
from tasks.undistort.resample import resampled
from tasks.undistort.reseau_marks import ENOUGH_MARKS, ReseauMarks
from tasks.undistort.settings import UndistortSettings

if TYPE_CHECKING:
    from matplotlib.figure import Figure

UNUSABLE_BITS = Quality.MISSING | Quality.OUTSIDE_WINDOW | Quality.SATURATED
NO_FIGURES: dict[str, float | None] = {
    "rmsd_px": None,
    "leave_one_out_px": None,
    "leave_one_out_median_px": None,
    "condition_number": None,
}
RAW_SUFFIXES = {"_GEOMED.IMG": "_RAW.IMG", ".geo": ".raw"}


def distortion_report(path: Path, out: Path | None = None, camera: str | None = None) -> dict[str, Any]:
    """Measure every distortion method on one image file; write the figures into `out` (None: none).

    Returns plain JSON: product, camera, marks_found, marks_expected, marks (count per state), methods {name: {rmsd_px,
    leave_one_out_px, leave_one_out_median_px, condition_number}}, chosen, and more beside. A frame that is already
    undistorted (GEOMED) is compared with the raw one beside it, if there is one. Raises RefusedError for files that
    cannot be read and cameras that are unknown.
    """
    frame = read_frame(path, camera)
    if frame.camera is None:
        raise RefusedError(Reason.CAMERA_UNKNOWN, f"image {path} does not say its camera.", "Give --camera.")
    known = find_camera(frame.camera if camera is None else camera)
    report: dict[str, Any] = {"product": frame.product, "camera": known.name, "format": frame.format}
    if frame.undistorted:
        return report | _of_corrected(path, frame, known, out)
    seen, _ = seen_marks(frame.observation, known)
    return report | (_of_optics(frame, known, out) if seen is None else _of_marks(path, frame, known, seen, out))


def _of_marks(path: Path, frame: Frame, camera: Camera, seen: SeenMarks, out: Path | None) -> dict[str, Any]:
    """The report for a raw frame with reseau marks."""
    marks = seen.marks
    mark_set, used = _mark_set(camera, seen)
    methods = METHODS if seen.bending is not None and used == "found" else [m for m in METHODS if m not in OF_A_FRAME]
    sizes = (camera.detector_size_px, camera.size_px)
    models = {
        method: fitted_to_frame(method, seen, sizes, None) if method in OF_A_FRAME else fit_model(method, mark_set)
        for method in methods
    }
    chosen = chosen_method(camera, UndistortSettings(), seen)
    report = {
        "marks_found": int(marks.found.sum()),
        "marks_expected": len(marks.found),
        "marks": marks.counts(),
        "marks_used": used,
        "mark_sigma_px": float(np.median(marks.sigma_px[marks.found])) if marks.found.any() else None,
        "methods": {method: model.report.summary() for method, model in models.items()},
        "chosen": chosen,
        "radial_about_pixel_zero_rmsd_px": radial_rmsd_from_corner(mark_set),
        "polynomial_in_pixel_powers_condition_number": monomial_condition_number(mark_set),
        "seconds": _timed(frame, camera),
    }
    bent = models.get(BENDING)
    if isinstance(bent, BentModel):
        report["bending"] = {"px_per_dn": bent.px_per_dn, "spread_px_per_dn": bent.spread}
    report |= _against_archive(path, camera, marks)
    reports = [model.report for model in models.values()]
    plane = uncertainty_plane(models[chosen])
    report["uncertainty_median_px"] = float(np.median(plane))
    figures = {
        "marks": partial(marks_figure, frame.observation, marks, frame.product),
        "displacement": partial(displacement_figure, models[chosen], frame.product),
        "residuals": partial(residuals_figure, reports, camera.size_px, frame.product),
        "uncertainty": partial(uncertainty_figure, plane, frame.product),
    }
    return report | {"figures": _saved(figures, out, frame.product)}


def _mark_set(camera: Camera, seen: SeenMarks) -> tuple[MarkSet, str]:
    sizes = (camera.detector_size_px, camera.size_px)
    if uses_found_marks(UndistortSettings(), seen):
        return marks_of_frame(seen.marks, *sizes), "found"
    table = table_of(camera)
    if table is None:
        raise RefusedError(Reason.DISTORTION_WITHOUT_MARKS, f"camera {camera.name} has no reseau marks.")
    return marks_of_table(table, *sizes), "nominal"


def _of_optics(frame: Frame, camera: Camera, out: Path | None) -> dict[str, Any]:
    """The report for a camera whose distortion is a formula."""
    known = camera.distortion.parameters
    names = [name for name in OPTICS_NAMES if name in ("none", camera.distortion.model) or name in known]
    models = {name: chosen_model(camera, UndistortSettings.model_validate({"method": name}))[0] for name in names}
    chosen = chosen_method(camera, UndistortSettings())
    figures = {
        f"distortion-{name}": partial(distortion_map_figure, model, camera.name)
        for name, model in models.items()
        if name != "none"
    }
    return {
        "marks_found": 0,
        "marks_expected": 0,
        "methods": {name: NO_FIGURES | _size_of(model) for name, model in models.items()},
        "chosen": chosen,
        "figures": _saved(figures, out, frame.product),
    }


def _size_of(model: DistortionModel) -> dict[str, float]:
    """How far the model moves the corners and the frame's pixels, and how well it inverts."""
    x, y = (np.linspace(0.0, n - 1.0, 60) for n in model.raw_size_px)
    raw = np.stack(np.meshgrid(x, y), axis=-1)
    undistorted = model.undistort_points(raw)
    shift = np.linalg.norm(undistorted - raw, axis=-1)
    corners = float(shift[[0, 0, -1, -1], [0, -1, 0, -1]].mean())
    round_trip = float(np.abs(model.distort_points(undistorted) - raw).max())
    return {
        "corner_shift_px": corners,
        "rms_shift_px": float(np.sqrt((shift**2).mean())),
        "largest_shift_px": float(shift.max()),
        "round_trip_px": round_trip,
    }


def _of_corrected(path: Path, frame: Frame, camera: Camera, out: Path | None) -> dict[str, Any]:
    """The report for a GEOMED frame: what distortion is left in it, measured against our own undistortion."""
    report: dict[str, Any] = {"marks_found": 0, "marks_expected": 0, "methods": {}, "chosen": "already undistorted"}
    raw_path = _raw_beside(path)
    if raw_path is None:
        return report | {"residual": None, "figures": []}
    raw = read_frame(raw_path, camera.name)
    ours, corrected = undistort(raw.observation, camera, UndistortSettings()).observation, frame.observation
    usable = ((ours.quality | corrected.quality) & UNUSABLE_BITS) == 0
    field = displacement_field(ours.image, corrected.image, usable)
    report |= {"raw": raw_path.name, "residual": field.summary()}
    if len(field.xy) >= ENOUGH_MARKS:
        again = resampled(corrected, residual_model(field, camera.size_px))
        usable &= (again.quality & UNUSABLE_BITS) == 0
        report["residual_after_correction"] = displacement_field(ours.image, again.image, usable).summary()
    caption = f"{frame.product} against our undistortion"
    figures = {"against-raw": partial(comparison_figure, field, ours.image, caption)}
    return report | {"figures": _saved(figures, out, frame.product)}


def _raw_beside(path: Path) -> Path | None:
    for suffix, raw_suffix in RAW_SUFFIXES.items():
        if path.name.endswith(suffix):
            raw = path.with_name(path.name.removesuffix(suffix) + raw_suffix)
            return raw if raw.is_file() else None
    return None


def _against_archive(path: Path, camera: Camera, marks: ReseauMarks) -> dict[str, Any]:
    """Agreement of the found marks with the Ring Node's own table beside the image."""
    stem = path.name.partition("_")[0]
    tables = [path.with_name(f"{stem}_{kind}") for kind in ("RESLOC.DAT", "RESLOC.TAB", "GEOMA.DAT", "GEOMA.TAB")]
    there = next((table for table in tables if table.is_file()), None)
    nominal = table_of(camera)
    if there is None or nominal is None or not marks.found.any():
        return {}
    archive = read_archive_marks(there, nominal)
    distance = np.linalg.norm((marks.xy - archive.raw_xy)[marks.found], axis=1)
    figures = {"median_px": float(np.median(distance)), "p95_px": float(np.percentile(distance, 95))}
    return {"archive_table": {"file": there.name, **figures}}


def _timed(frame: Frame, camera: Camera) -> dict[str, float]:
    """Seconds to find and fill the marks, to fit the chosen model, to map the frame once, and to undistort one image
    then (best of three)."""
    seconds: dict[str, float] = {}

    def timed(name: str, action: Any) -> Any:
        started = time.perf_counter()
        result = action()
        seconds[name] = round(min(time.perf_counter() - started, seconds.get(name, np.inf)), 4)
        return result

    seen, clean = timed("marks", lambda: seen_marks(frame.observation, camera))
    model = timed("fit", lambda: chosen_model(camera, UndistortSettings(), seen)[0])
    timed("first_undistort", lambda: resampled(clean, model))
    for _ in range(3):
        timed("undistort", lambda: resampled(clean, model))
    return seconds


def _saved(figures: "Mapping[str, Callable[[], Figure]]", out: Path | None, product: str) -> list[str]:
    """Draw the figures, write them as PNG and return their paths; draw none without a folder."""
    if out is None:
        return []
    out.mkdir(parents=True, exist_ok=True)
    paths = [out / f"{product}-{name}.png" for name in figures]
    for path, drawn in zip(paths, figures.values(), strict=True):
        drawn().savefig(path, format="png")
    return [str(path) for path in paths]
