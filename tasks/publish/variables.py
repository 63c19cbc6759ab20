"""The one table of what a geometry cube holds; every cube is checked against it before it is written."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from catalog.observation import Quality
from tasks.publish.publication import SENSOR

if TYPE_CHECKING:
    import xarray as xr

    from tasks.publish.plain_cube import PlainCube, Plane

GRID_MAPPING = "crs"
COORDINATES = ("latitude", "longitude")
DIMENSIONS = ("y", "x")


@dataclass(frozen=True)
class Variable:
    """One plane of the cube. valid_range: inclusive, None where any finite value is sensible. standard_name: of CF,
    empty where CF has none. on_body: NaN exactly where the pixel does not see the body; may_be_unknown: or NaN
    everywhere. dims: other than the cube's own for a plane with pixels of its own. grid_mapping: of a map."""

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
    dims: tuple[str, ...] = DIMENSIONS
    grid_mapping: str = ""

    @property
    def attributes(self) -> dict[str, Any]:
        """CF attributes; valid_range in the variable's own type."""
        kind = np.dtype(self.dtype).type
        limits = {"valid_range": [kind(v).item() for v in self.valid_range]} if self.valid_range else {}
        texts = {
            "standard_name": self.standard_name,
            "comment": self.comment,
            "ancillary_variables": self.ancillary,
            "grid_mapping": self.grid_mapping,
        }
        given = {key: text for key, text in texts.items() if text}
        return {"long_name": self.long_name, "units": self.units, **given, **limits}


FLAGS = tuple(Quality)

VARIABLES = (
    Variable(
        "image", "float32", "1", "image", on_body=False, ancillary="quality",
        comment="in the unit of the source file (DN, or what it was calibrated to); the attribute pixel_space of the "
        "cube says whether its pixels were resampled into the undistorted frame or are those of the detector",
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
        "sensor_zenith_angle", (0.0, 90.05),
        comment="from the apparent direction, as SPICE's ILUMIN counts it: above 90 by aberration at the limb",
    ),
    Variable("phase", "float32", "degree", "phase angle: Sun - surface point - spacecraft", "", (0.0, 180.0)),
    Variable("range_km", "float32", "km", "distance from the spacecraft to the surface point", "", (0.0, 1e11)),
    Variable(
        "resolution_km", "float32", "km", "longer side of the pixel's footprint", "", (0.0, 1e11),
        comment="range / focal length in pixels of the cube / cos(emission)",
    ),
    Variable(
        "latitude_uncertainty", "float32", "degree",
        "1-sigma of the latitude from the uncertainties of pose and distortion",
        "latitude standard_error", (0.0, 90.0), may_be_unknown=True,
    ),
    Variable(
        "longitude_uncertainty", "float32", "degree",
        "1-sigma of the longitude from the uncertainties of pose and distortion",
        "longitude standard_error", (0.0, 180.0), may_be_unknown=True,
    ),
    Variable(
        "distortion_uncertainty", "float32", "1",
        "1-sigma of each coordinate of the pixel's place in the undistorted frame, in undistorted pixels", "",
        (0.0, 1e4), on_body=False, may_be_unknown=True, comment="0 when the distortion model claims no error",
    ),
    Variable("quality", "uint16", "1", "quality of the pixel", "quality_flag", on_body=False),
)  # fmt: skip

SENSOR_VARIABLES = (
    Variable("place_x", "float32", "1", "x of the pixel's centre in the undistorted frame", on_body=False),
    Variable("place_y", "float32", "1", "y of the pixel's centre in the undistorted frame", on_body=False),
    Variable(
        "resampled_image", "float32", "1", "image resampled into the undistorted frame", on_body=False,
        comment="the frame in which the pose was found; its own pixels, not those of the other variables",
        dims=("y_resampled", "x_resampled"),
    ),
)  # fmt: skip

BODY_VARIABLES = (
    Variable(
        "body_id", "int32", "1", "NAIF id of the body that the pixel sees, 0 for none", on_body=False,
        comment="latitude to resolution_km are of this body; where it is not the target, quality has other_body",
    ),
    Variable(
        "shadow", "float32", "1", "fraction of the Sun's disk that other bodies and rings cover at the surface", "",
        (0.0, 1.0), comment="1 in the umbra; whether the Sun is up there is another matter, see incidence",
    ),
    Variable(
        "ring_optical_depth", "float32", "1", "optical depth along the line of sight of the rings before what is seen",
        "", (0.0, 1e13), on_body=False, comment="0 without; the light that comes through is exp(-depth)",
    ),
)  # fmt: skip

BY_NAME = {variable.name: variable for variable in VARIABLES + SENSOR_VARIABLES + BODY_VARIABLES}


def variables_of(pixel_space: str, several_bodies: bool = False) -> tuple[Variable, ...]:
    """What a cube in this pixel space holds. several_bodies: another body or a ring concerns its frame."""
    variables = VARIABLES + SENSOR_VARIABLES if pixel_space == SENSOR else VARIABLES
    return variables + BODY_VARIABLES if several_bodies else variables


REQUIRED_ATTRIBUTES = (
    "Conventions", "title", "source", "history", "product", "camera", "target", "utc",
    "pose_before", "pose_after", "uncertainty", "settings", "provenance", "pixel_space", "resampling_kernel",
)  # fmt: skip


def cube_faults(cube: "xr.Dataset | PlainCube") -> list[str]:
    """Everything in which a cube departs from the table: missing or wrong variables, types, shapes, units, values."""
    faults = [f"attribute {name} is missing" for name in REQUIRED_ATTRIBUTES if name not in cube.attrs]
    if GRID_MAPPING not in cube.variables:
        faults.append(f"variable {GRID_MAPPING} is missing")
    several = any(variable.name in cube.variables for variable in BODY_VARIABLES)
    variables = variables_of(cube.attrs.get("pixel_space", ""), several)
    missing = [variable.name for variable in variables if variable.name not in cube.variables]
    faults += [f"variable {name} is missing" for name in missing]
    if missing:
        return faults
    on_body = (cube["quality"].values & Quality.OFF_BODY) == 0
    for variable in variables:
        faults += [f"{variable.name}: {fault}" for fault in _faults(variable, cube[variable.name], on_body)]
    return faults


def _faults(variable: Variable, array: "xr.DataArray | Plane", on_body: NDArray[np.bool_]) -> list[str]:
    if array.dims != variable.dims or (variable.dims == DIMENSIONS and array.shape != on_body.shape):
        return [f"dimensions {array.dims} of {array.shape}, expected {variable.dims} of {on_body.shape}"]
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
