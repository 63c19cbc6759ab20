"""The true distortion of simulated frames: never a fit that the corrections would make.

Voyager: the camera's nominal table of marks, interpolated by a cubic radial basis (the corrections fit thin plates), a
smooth deformation that changes from frame to frame, and the bending of the beam by the picture's own brightness.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catalog.camera import Camera
from catalog.observation import Observation
from catalog.reseau import find_reseau_table
from tasks.undistort import DistortionModel, UndistortSettings, undistort
from tasks.undistort.bending import USUAL_PX_PER_DN, USUAL_SPREAD_PX_PER_DN, BendingField, bending_field
from tasks.undistort.model import Identity, solve_points
from tasks.undistort.optics import optics_model

Array = NDArray[np.float64]
# Measured in f1636832.raw, C1124748_RAW, C3580800_RAW, C2069302_RAW and c4400436: marks found minus the table's, as
# polynomials of the place: coefficients of degree 1 are 0.1-1.7 px, 2 and 3 together leave 0.2-0.7 px.
SPREAD_PX = {0: 0.4, 1: 0.5, 2: 0.3, 3: 0.2}
DEGREES = [(i, j) for total in SPREAD_PX for i in range(total, -1, -1) for j in (total - i,)]
INVERSE_STEPS = 12


@dataclass(frozen=True, eq=False)
class TrueOptics:
    """undistorted = forward(raw) + px_per_dn * bending(raw). marks_xy: raw places (n, 2) of the reseau marks, without
    bending; marks_object_xy: their undistorted ones. facts: plain values for the record."""

    raw_size_px: tuple[int, int]
    forward: Callable[[Array], Array]
    marks_xy: Array | None = None
    marks_object_xy: Array | None = None
    px_per_dn: float = 0.0
    bending: BendingField | None = None
    facts: dict[str, Any] = field(default_factory=dict)

    def undistort_points(self, xy_raw: ArrayLike) -> Array:
        """Undistorted places (..., 2) of raw pixels (..., 2)."""
        raw = np.asarray(xy_raw, dtype=np.float64)
        flat = raw.reshape(-1, 2)
        undistorted = self.forward(flat)
        if self.bending is not None:
            undistorted = undistorted + self.px_per_dn * self.bending(flat)
        return np.asarray(undistorted.reshape(raw.shape))

    def distort_points(self, xy: ArrayLike, start: ArrayLike) -> Array:
        """Raw places (..., 2) of undistorted pixels (..., 2), searched from `start`; NaN where the search fails."""
        return solve_points(self.undistort_points, xy, start)

    def bent_by(self, observation: Observation, saturation_dn: float | None) -> "TrueOptics":
        """The same with the beam bending of a frame."""
        if not self.px_per_dn:
            return self
        return TrueOptics(
            self.raw_size_px,
            self.forward,
            self.marks_xy,
            self.marks_object_xy,
            self.px_per_dn,
            bending_field(observation, saturation_dn),
            self.facts,
        )

    def visible_marks_xy(self) -> Array | None:
        """Raw places (n, 2) where the marks are seen, bending included."""
        if self.marks_xy is None or self.marks_object_xy is None or self.bending is None:
            return self.marks_xy
        raw = self.marks_xy.copy()
        for _ in range(INVERSE_STEPS):
            raw = raw + (self.marks_object_xy - self.undistort_points(raw)) * 0.8  # raw pixels are 1.2 times as large
        return raw


def true_optics(camera: Camera, rng: np.random.Generator, marks_shift_px: tuple[float, float]) -> TrueOptics:
    """The distortion of one frame of `camera`, its changing part drawn from `rng`.

    LORRI: nh_lorri_v201's model; SSI: the cubic one (a calibrated camera's distortion does not change).
    """
    if camera.distortion.model == "reseau":
        return _vidicon(camera, rng, marks_shift_px)
    name = "lorri-em" if camera.name == "newhorizons-lorri" else camera.distortion.model
    model: DistortionModel = Identity(camera.size_px)
    if name != "none":
        given = camera.distortion.parameters
        own = {key: value for key, value in given.items() if not isinstance(value, dict)}
        model = optics_model(name, camera, own if name == camera.distortion.model else given[name])
    return TrueOptics(camera.detector_size_px, model.undistort_points, facts={"kind": name})


def nominal_optics(camera: Camera) -> TrueOptics:
    """The distortion that the corrections assume by default, for matched simulations."""
    columns, rows = camera.detector_size_px
    empty = np.zeros((rows, columns), np.float32)
    nothing = Observation(empty, empty, empty.astype(np.uint16))
    model = undistort(nothing, camera, UndistortSettings(space="sensor")).model
    table = camera.distortion.parameters.get("table")
    marks = find_reseau_table(table) if table else None
    return TrueOptics(
        camera.detector_size_px,
        model.undistort_points,
        marks.raw_xy if marks else None,
        marks.object_xy if marks else None,
        facts={"kind": f"nominal ({model.name})"},
    )


def _vidicon(camera: Camera, rng: np.random.Generator, marks_shift_px: tuple[float, float]) -> TrueOptics:
    from scipy.interpolate import RBFInterpolator

    table = find_reseau_table(str(camera.distortion.parameters["table"]))
    nominal = RBFInterpolator(table.raw_xy, table.object_xy, kernel="cubic", degree=3)
    spread = np.array([SPREAD_PX[i + j] for i, j in DEGREES])
    coefficients = rng.standard_normal((len(DEGREES), 2)) * spread[:, None]
    coefficients[0] += marks_shift_px
    half = np.asarray(camera.detector_size_px) / 2

    def deformation(raw: Array) -> Array:
        x, y = (np.clip(raw, -40, 2 * half + 40) / half - 1).T
        return np.stack([x**i * y**j for i, j in DEGREES], axis=1) @ coefficients

    def forward(raw: Array) -> Array:
        return np.asarray(nominal(raw - deformation(raw)))

    marks = table.raw_xy.copy()
    for _ in range(INVERSE_STEPS):
        marks = table.raw_xy + deformation(marks)
    px_per_dn = float(max(rng.normal(USUAL_PX_PER_DN, USUAL_SPREAD_PX_PER_DN), 0.0))
    facts = {
        "kind": "reseau",
        "table": table.name,
        "deformation_px": {f"x^{i} y^{j}": c.tolist() for (i, j), c in zip(DEGREES, coefficients, strict=True)},
        "bending_px_per_dn": px_per_dn,
    }
    return TrueOptics(camera.detector_size_px, forward, marks, table.object_xy, px_per_dn, facts=facts)
