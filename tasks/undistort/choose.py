"""From camera file, settings and frame to a distortion model."""

from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

from catalog.camera import Camera
from catalog.errors import RefusedError
from catalog.reasons import Reason
from catalog.reseau import ReseauTable, find_reseau_table
from catalog.reseau.archive import is_archive_table, read_archive_marks
from tasks.undistort.bending import BendingField
from tasks.undistort.bent_plate import BentModel
from tasks.undistort.mark_set import MarkSet, marks_of_frame, marks_of_table
from tasks.undistort.methods import METHODS, OF_A_FRAME, FittedModel, fit_model
from tasks.undistort.model import DistortionModel
from tasks.undistort.optics import OPTICS_NAMES, optics_model
from tasks.undistort.reseau_marks import ENOUGH_MARKS, ReseauMarks
from tasks.undistort.settings import UndistortSettings
from tasks.undistort.summed import SummedModel
from tasks.undistort.turned import TurnedModel

RESEAU = "reseau"


@dataclass(frozen=True, eq=False)
class SeenMarks:
    """What a frame shows: its marks, and the bending of the beam that follows from its brightness."""

    marks: ReseauMarks
    bending: BendingField | None = None

    @property
    def count(self) -> int:
        """How many marks were found."""
        return int(self.marks.found.sum())


def chosen_model(
    camera: Camera, settings: UndistortSettings, seen: SeenMarks | None = None
) -> tuple[DistortionModel, dict[str, Any]]:
    """The model that the settings choose for the camera, and evidence (plain values) about it.

    seen: what was measured in the frame; without it the camera's nominal table is used. Raises RefusedError when the
    camera lacks what the method needs, or the marks do not carry the method.
    """
    if camera.unsummed is not None:
        whole, evidence = chosen_model(camera.unsummed, settings)
        return SummedModel(whole, camera.summing, camera.detector_size_px, camera.size_px), evidence
    method = chosen_method(camera, settings, seen)
    model: DistortionModel
    if method in OPTICS_NAMES:
        model, evidence = optics_model(method, camera, _parameters(camera, method)), {"method": method}
    else:
        model, evidence = _fitted(camera, settings, method, seen)
    if settings.roll == "none":
        return model, evidence
    roll_deg = float(_given(camera, "published_roll_deg"))
    return TurnedModel(model, roll_deg, camera.centre_px), {**evidence, "roll_deg": roll_deg}


def chosen_method(camera: Camera, settings: UndistortSettings, seen: SeenMarks | None = None) -> str:
    """Name of the method: the settings', or what the camera file names; the best one for reseau cameras depends on
    what was seen in the frame. Raises RefusedError for an unknown method."""
    method = camera.distortion.model if settings.method == "camera" else settings.method
    if settings.method == "camera" and method in settings.left_out:
        return "none"
    if method == RESEAU:
        method = best_method(camera, settings, seen)
    if method in METHODS and camera.distortion.model != RESEAU:
        raise RefusedError(
            Reason.DISTORTION_WITHOUT_MARKS,
            f"camera {camera.name} has no reseau marks, which the method {method} is fitted to.",
            f"Use one of {', '.join(OPTICS_NAMES)}, or name a reseau table in the camera file.",
        )
    if method not in (*METHODS, *OPTICS_NAMES):
        raise RefusedError(
            Reason.DISTORTION_UNKNOWN,
            f"camera {camera.name} names the distortion model {method!r}.",
            f"Known are {', '.join(OPTICS_NAMES)} and {RESEAU}.",
        )
    return method


def best_method(camera: Camera, settings: UndistortSettings, seen: SeenMarks | None) -> str:
    """Name of the method for a reseau camera whose file leaves the choice open: the one that predicts this frame's
    marks best when each is left out."""
    if seen is None or not uses_found_marks(settings, seen):
        return "thin-plate"
    if settings.with_marks:
        return settings.with_marks
    if seen.bending is None:
        return "thin-plate"
    sizes = (camera.detector_size_px, camera.size_px)
    reports = {method: fitted_to_frame(method, seen, sizes, settings.degree).report for method in OF_A_FRAME}
    return min(reports, key=lambda method: reports[method].robust_leave_one_out_px)


@lru_cache(maxsize=4)
def fitted_to_frame(
    method: str, seen: SeenMarks, sizes_px: tuple[tuple[int, int], tuple[int, int]], degree: int | None
) -> FittedModel:
    """The method fitted to a frame's own marks; the last few are remembered. sizes_px: of the camera's detector and of
    its undistorted frame. Raises RefusedError as `fit_model`."""
    marks = marks_of_frame(seen.marks, *sizes_px)
    return fit_model(method, marks, degree, seen.bending)


def uses_found_marks(settings: UndistortSettings, seen: SeenMarks | None) -> bool:
    """Whether the model is fitted to the frame's own marks."""
    return settings.marks in ("auto", "found") and seen is not None and seen.count >= ENOUGH_MARKS


def table_of(camera: Camera) -> ReseauTable | None:
    """The camera's nominal reseau table, None for a camera without marks."""
    return find_reseau_table(str(_given(camera, "table"))) if camera.distortion.model == RESEAU else None


def _fitted(
    camera: Camera, settings: UndistortSettings, method: str, seen: SeenMarks | None
) -> tuple[FittedModel, dict[str, Any]]:
    evidence: dict[str, Any] = {"method": method}
    if seen is not None:
        counts = {"marks_found": seen.count, "marks_expected": len(seen.marks.found)}
        evidence |= counts | {"marks_by_state": seen.marks.counts()}
    if seen is not None and uses_found_marks(settings, seen):
        model = fitted_to_frame(method, seen, (camera.detector_size_px, camera.size_px), settings.degree)
        return model, {**evidence, "marks": "found", **_quality(model)}
    if settings.marks == "found":
        raise RefusedError(
            Reason.MARKS_NOT_FOUND,
            f"only {0 if seen is None else seen.count} reseau marks were found, {ENOUGH_MARKS} are needed.",
            "Use marks = auto or nominal; cleaned and corrected products have no marks any more.",
        )
    name = "nominal" if settings.marks == "auto" else settings.marks
    model = _fitted_to_table(camera, name, method, settings.degree)
    return model, {**evidence, "marks": name, **_quality(model)}


def _quality(model: FittedModel) -> dict[str, Any]:
    """The fit's figures; a triangulation's leave-one-out takes a second, so it is left to those who ask for it."""
    figures: dict[str, Any] = {"marks_used": int(model.marks.found.sum())}
    if isinstance(model, BentModel):
        figures |= {"bending_px_per_dn": model.px_per_dn, "bending_spread_px_per_dn": model.spread}
    return figures | ({} if model.name == "delaunay" else model.report.summary())


def _fitted_to_table(camera: Camera, name: str, method: str, degree: int | None) -> FittedModel:
    nominal = str(_given(camera, "table"))
    if name == "nominal":
        return _fitted_to_nominal(nominal, camera.detector_size_px, camera.size_px, method, degree)
    is_archive = is_archive_table(Path(name))
    table = read_archive_marks(Path(name), find_reseau_table(nominal)) if is_archive else find_reseau_table(name)
    return fit_model(method, marks_of_table(table, camera.detector_size_px, camera.size_px), degree)


@cache
def _fitted_to_nominal(
    table: str, raw_size_px: tuple[int, int], size_px: tuple[int, int], method: str, degree: int | None
) -> FittedModel:
    marks: MarkSet = marks_of_table(find_reseau_table(table), raw_size_px, size_px)
    return fit_model(method, marks, degree)


def _parameters(camera: Camera, method: str) -> dict[str, Any]:
    """What [distortion] gives for its own model, or its sub-table [distortion.<method>] for another."""
    given = camera.distortion.parameters
    if method == camera.distortion.model:
        return {key: value for key, value in given.items() if not isinstance(value, dict)}
    return dict(given.get(method, {}))


def _given(camera: Camera, key: str) -> Any:
    if key not in camera.distortion.parameters:
        raise RefusedError(
            Reason.DISTORTION_INCOMPLETE,
            f"camera {camera.name}: its distortion lacks {key}.",
            f"Add {key} to the camera file's [distortion] section.",
        )
    return camera.distortion.parameters[key]
