"""The one table of what a geometry cube holds; every cube is checked against it before it is written."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from catalog.observation import Quality

if TYPE_CHECKING:
    import xarray as xr

GRID_MAPPING = "crs"
COORDINATES = ("latitude", "longitude")


@dataclass(frozen=True)
class Variable:
    """One plane (y, x) of the cube. valid_range: inclusive, None where any finite value is sensible. standard_name: of
    CF, empty where CF has none. on_body: NaN exactly where the pixel does not see the body; may_be_unknown: or NaN
    everywhere."""

    name: str
    dtype: str
    units: str
    long_name: str
    standard_name: str = ""
    valid_range: tuple[float, float] | None = None
    on_body: bool = True
    may_be_unknown: bool = False
    comment: str = ""
    ancillary: str = ""

    @property
    def attributes(self) -> dict[str, Any]:
        """CF attributes; valid_range in the variable's own type."""
        kind = np.dtype(self.dtype).type
        limits = {"valid_range": [kind(v).item() for v in self.valid_range]} if self.valid_range else {}
        texts = {
            "standard_name": self.standard_name,
            "comment": self.comment,
            "ancillary_variables": self.ancillary,
        }
        given = {key: text for key, text in texts.items() if text}
        return {"long_name": self.long_name, "units": self.units, **given, **limits}


FLAGS = tuple(Quality)

VARIABLES = (
    Variable(
        "image", "float32", "1", "undistorted image", on_body=False, ancillary="quality",
        comment="in the unit of the source file (DN, or what it was calibrated to)",
    ),
    Variable(
        "latitude", "float32", "degrees_north", "planetocentric latitude", "latitude", (-90.0, 90.0),
        ancillary="latitude_uncertainty",
    ),
    Variable(
        "longitude", "float32", "degrees_east", "longitude, positive eastward, 0 <= longitude < 360", "longitude",
        (0.0, 360.0), ancillary="longitude_uncertainty",
    ),
    Variable(
        "incidence", "float32", "degree", "incidence angle: between the ellipsoid's normal and the Sun",
        "solar_zenith_angle", (0.0, 180.0), comment="above 90 on the night side, which quality marks",
    ),
    Variable(
        "emission", "float32", "degree", "emission angle: between the ellipsoid's normal and the spacecraft",
        "sensor_zenith_angle", (0.0, 90.001),
    ),
    Variable("phase", "float32", "degree", "phase angle: Sun - surface point - spacecraft", "", (0.0, 180.0)),
    Variable("range_km", "float32", "km", "distance from the spacecraft to the surface point", "", (0.0, 1e11)),
    Variable(
        "resolution_km", "float32", "km", "longer side of the pixel's footprint", "", (0.0, 1e11),
        comment="range / focal length in pixels / cos(emission)",
    ),
    Variable(
        "latitude_uncertainty", "float32", "degree", "1-sigma of the latitude from the pose's uncertainty",
        "latitude standard_error", (0.0, 90.0), may_be_unknown=True,
    ),
    Variable(
        "longitude_uncertainty", "float32", "degree", "1-sigma of the longitude from the pose's uncertainty",
        "longitude standard_error", (0.0, 180.0), may_be_unknown=True,
    ),
    Variable("quality", "uint16", "1", "quality of the pixel", "quality_flag", on_body=False),
)  # fmt: skip

BY_NAME = {variable.name: variable for variable in VARIABLES}

REQUIRED_ATTRIBUTES = (
    "Conventions", "title", "source", "history", "product", "camera", "target", "utc",
    "pose_before", "pose_after", "uncertainty", "settings", "provenance",
)  # fmt: skip


def cube_faults(cube: "xr.Dataset") -> list[str]:
    """Everything in which a cube departs from the table: missing or wrong variables, types, shapes, units, values."""
    faults = [f"attribute {name} is missing" for name in REQUIRED_ATTRIBUTES if name not in cube.attrs]
    if GRID_MAPPING not in cube.variables:
        faults.append(f"variable {GRID_MAPPING} is missing")
    missing = [variable.name for variable in VARIABLES if variable.name not in cube.variables]
    faults += [f"variable {name} is missing" for name in missing]
    if missing:
        return faults
    on_body = (cube["quality"].values & Quality.OFF_BODY) == 0
    for variable in VARIABLES:
        faults += [f"{variable.name}: {fault}" for fault in _faults(variable, cube[variable.name], on_body)]
    return faults


def _faults(variable: Variable, array: "xr.DataArray", on_body: NDArray[np.bool_]) -> list[str]:
    if array.dims != ("y", "x") or array.shape != on_body.shape:
        return [f"dimensions {array.dims} of {array.shape}, expected ('y', 'x') of {on_body.shape}"]
    if array.dtype != variable.dtype:
        return [f"type {array.dtype}, expected {variable.dtype}"]
    expected = variable.attributes.items()
    wrong = {key: (array.attrs.get(key), value) for key, value in expected if array.attrs.get(key) != value}
    faults = [f"attribute {key} is {found!r}, expected {value!r}" for key, (found, value) in wrong.items()]
    return faults + _value_faults(variable, array.values, on_body)


def _value_faults(variable: Variable, values: NDArray[Any], on_body: NDArray[np.bool_]) -> list[str]:
    faults = []
    known = np.isfinite(values)
    unknown_as_a_whole = variable.may_be_unknown and not known.any()
    if variable.on_body and not unknown_as_a_whole and not np.array_equal(known, on_body):
        faults.append("finite values and the off_body flag disagree")
    if variable.valid_range and known.any():
        low, high = float(values[known].min()), float(values[known].max())
        if low < variable.valid_range[0] or high > variable.valid_range[1]:
            faults.append(f"values from {low:g} to {high:g}, valid is {variable.valid_range}")
        if variable.name == "longitude" and high >= 360:
            faults.append("a longitude reaches 360")
    return faults
