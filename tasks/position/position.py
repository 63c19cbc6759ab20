"""What single positions of an image see, and where places of the body are in it, with 1-sigma of everything.

Values are those of the pose, computed for the position itself (see `tasks.project`), not interpolated in planes. Sigmas
are linear: sqrt(J C J^T), C the covariance of the pose, J by differences of moved poses; what the distortion adds to a
pixel's place is added in squares.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catalog.camera import Camera
from catalog.pose import Pose
from catalog.target import Target
from tasks.joint.parameters import State
from tasks.position.model import PositionModel
from tasks.position.sunlight import sunlit_points
from tasks.project.pixels import seen_at
from tasks.project.places import Places, find_places, geometry_of_places
from tasks.project.seen import scattered
from tasks.project.uncertainty import PARAMETERS, coordinate_sigmas

Array = NDArray[np.float64]
Values = dict[str, Array]

QUANTITIES = ("latitude", "longitude", "incidence", "emission", "phase", "range_km")
FIELDS = ("latitude_deg", "longitude_deg", "incidence_deg", "emission_deg", "phase_deg", "range_km")
GIVEN_BY_PLACE = 2  # latitude and longitude, which have no sigma then
# Steps of the differences: px, range's logarithm, degrees. Some 1e-5 of a pixel to a hundredth on the detector, where
# the projection is straight to nine digits and rounding is far away.
STEPS = (1e-2, 1e-2, 1e-6, 1e-3, 1e-3, 1e-3, 1e-3)
PLACE_STEP_PX = 1e-2
HORIZON_DEG = 90.0


@dataclass(frozen=True)
class Position:
    """One position; None where a value is not there. Degrees, km, pixels of the image (0-based, integer at the centre);
    latitude planetocentric, longitude east. visible: whether the image's camera sees the place, be it outside of the
    frame. lit: whether the Sun's centre is above its horizon (a shape model's shadows too); None off the body. sigmas:
    1-sigma by the names of the values, None of what was given and where it is not known. remark: what is special, in
    words, empty otherwise. value, flags: of the nearest pixel, None outside of the frame."""

    product: str
    latitude_deg: float | None
    longitude_deg: float | None
    incidence_deg: float | None
    emission_deg: float | None
    phase_deg: float | None
    range_km: float | None
    x_px: float | None
    y_px: float | None
    visible: bool
    lit: bool | None
    sigmas: Mapping[str, float | None]
    remark: str
    value: float | None = None
    flags: tuple[str, ...] | None = None

    def to_dict(self) -> dict[str, object]:
        """Plain JSON."""
        return {**self.__dict__, "sigmas": dict(self.sigmas), "flags": None if self.flags is None else list(self.flags)}


def positions_of_pixels(model: PositionModel, xy_px: ArrayLike) -> list[Position]:
    """What the image's pixels (n, 2) see. Raises RefusedError when the pose puts spacecraft or Sun inside the body."""
    xy = np.asarray(xy_px, dtype=np.float64).reshape(-1, 2)
    undistorted, place_px = model.geometry.undistorted_of(xy), model.place_sigma_px(xy)
    camera, target = model.geometry.camera, model.geometry.target

    def values_at(pose: Pose, places: Array) -> Values:
        on_body, seen = seen_at(pose, camera, target, places)
        return scattered(on_body, sunlit_points(seen), QUANTITIES)

    on_body, plain = seen_at(model.geometry.pose, camera, target, undistorted, target.shape is not None)
    seen = sunlit_points(plain)
    values = scattered(on_body, seen, QUANTITIES)
    lit = np.zeros(len(xy), dtype=np.bool_)
    lit[on_body] = seen.sunlit
    sigmas = _sigmas(model, lambda pose: values_at(pose, undistorted), values)
    if sigmas:
        for step in PLACE_STEP_PX * np.eye(2):
            ahead, behind = (values_at(model.geometry.pose, undistorted + sign * step) for sign in (1, -1))
            slopes = _slopes(ahead, behind, values, PLACE_STEP_PX)
            sigmas = {name: np.hypot(sigmas[name], place_px * slopes[name]) for name in sigmas}
        uncertainty = model.uncertainty
        if target.shape is None and uncertainty is not None:  # as the cube has them
            points = seen.points_km.T
            both = coordinate_sigmas(model.geometry.pose, camera, target, uncertainty, points, place_px[on_body])
            sigmas["latitude"][on_body], sigmas["longitude"][on_body] = both
    rows = _rows(model, values, sigmas, xy, {}, on_body, np.where(on_body, lit, np.nan))
    return [_with_remark(row, _remark_of_pixel(model, row)) for row in rows]


def positions_of_places(model: PositionModel, latitude_deg: ArrayLike, longitude_deg: ArrayLike) -> list[Position]:
    """Where n places of planetocentric latitude and east longitude, degrees (n,), are in the image; `x_px` and `y_px`
    are None where it does not see them. Raises RefusedError as `positions_of_pixels`."""
    latitude, longitude = (np.asarray(a, dtype=np.float64).reshape(-1) for a in (latitude_deg, longitude_deg))
    pose, camera, target = model.geometry.pose, model.geometry.camera, model.geometry.target

    def values_at(moved: Pose) -> Values:
        return _values_of_places(moved, camera, target, find_places(moved, camera, target, latitude, longitude))

    places = find_places(pose, camera, target, latitude, longitude)
    values = _values_of_places(pose, camera, target, places)
    sigmas = _sigmas(model, values_at, values)
    place_px = np.where(places.visible[:, None], places.pixels, np.nan)
    xy = model.geometry.pixels_of(place_px)
    own = model.place_sigma_px(xy)
    pixel_sigmas = {}
    if sigmas:
        scale = _image_pixels_per_undistorted(model, place_px)
        for axis, name in enumerate(("x", "y")):
            pixel_sigmas[f"{name}_px"] = scale * np.hypot(sigmas.pop(f"place_{name}"), own)
            pixel_sigmas[f"{name}_px"][np.isnan(xy[:, axis])] = np.nan
        for name in QUANTITIES[:GIVEN_BY_PLACE]:
            sigmas[name] = np.full(len(latitude), np.nan)
    lit = _lit(model, places, values)
    values |= {"latitude": latitude, "longitude": longitude % 360.0}
    rows = _rows(model, values, sigmas, xy, pixel_sigmas, places.visible, lit)
    return [
        _with_remark(row, _remark_of_place(model, row, place, seen))
        for row, place, seen in zip(rows, places.pixels, places.visible, strict=True)
    ]


def _values_of_places(pose: Pose, camera: Camera, target: Target, places: Places) -> Values:
    seen = sunlit_points(geometry_of_places(pose, camera, target, places))
    values = {name: getattr(seen, name) for name in QUANTITIES}
    return values | {"place_x": places.pixels[:, 0], "place_y": places.pixels[:, 1]}


def _lit(model: PositionModel, places: Places, values: Values) -> Array:
    lit = np.where(np.isfinite(values["incidence"]), values["incidence"] < HORIZON_DEG, np.nan)
    if model.geometry.target.shape is not None:
        known, geometry = np.where(places.visible[:, None], places.pixels, np.nan), model.geometry
        on_body, seen = seen_at(geometry.pose, geometry.camera, geometry.target, known, shadows=True)
        lit[on_body] = seen.sunlit
    return lit


def _sigmas(model: PositionModel, values_at: Callable[[Pose], Values], here: Values) -> Values:
    """By name (n,), NaN where a value is not there; nothing where the solution states no uncertainty."""
    if model.uncertainty is None:
        return {}
    state, camera = State(model.geometry.pose, 1.0), model.geometry.camera
    slopes: dict[str, list[Array]] = {name: [] for name in here}
    for index, step in enumerate(STEPS):
        moves = np.zeros(8)
        moves[index] = step
        ahead, behind = (values_at(state.moved(sign * moves, camera).pose) for sign in (1, -1))
        found = _slopes(ahead, behind, here, step)
        for name, slope in found.items():
            slopes[name].append(slope)
    covariance = model.uncertainty.covariance
    if len(STEPS) != len(PARAMETERS):
        raise ValueError("one step for each parameter of the pose")
    return {
        name: np.sqrt(np.maximum(np.einsum("in,ij,jn->n", np.array(rows), covariance, np.array(rows)), 0.0))
        for name, rows in slopes.items()
    }


def _slopes(ahead: Values, behind: Values, here: Values, step: float) -> Values:
    """Derivatives (n,), by both sides, or by one where the other leaves the body."""
    found = {}
    for name, value in here.items():
        forward, backward = ahead[name] - value, value - behind[name]
        if name == "longitude":
            forward, backward = ((each + 180.0) % 360.0 - 180.0 for each in (forward, backward))
        both = np.stack([forward, backward])
        known = np.isfinite(both)
        number = known.sum(axis=0)
        mean = np.where(known, both, 0.0).sum(axis=0) / np.maximum(number, 1)
        found[name] = np.where(number > 0, mean, np.nan) / step
    return found


def _image_pixels_per_undistorted(model: PositionModel, place_px: Array) -> Array:
    """Length of the image's pixels, seen in the undistorted frame (n,): 1 but for raw frames."""
    if model.geometry.detector is None:
        return np.ones(len(place_px))
    steps = [model.geometry.pixels_of(place_px + half) for half in (np.array([[0.5, 0.0]]), np.array([[-0.5, 0.0]]))]
    return np.asarray(np.linalg.norm(steps[0] - steps[1], axis=1))


def _rows(
    model: PositionModel,
    values: Values,
    sigmas: Values,
    xy: Array,
    pixel_sigmas: Values,
    visible: NDArray[np.bool_],
    lit: Array,
) -> list[Position]:
    rows = []
    for i in range(len(xy)):
        found = {field: _number(values[name][i]) for field, name in zip(FIELDS, QUANTITIES, strict=True)}
        stated = {f: _number(sigmas[n][i]) if sigmas else None for f, n in zip(FIELDS, QUANTITIES, strict=True)}
        stated |= {n: _number(pixel_sigmas[n][i]) if pixel_sigmas else None for n in ("x_px", "y_px")}
        x, y = (_number(v) for v in xy[i])
        value, flags = model.pixel(xy[i])
        shines = None if np.isnan(lit[i]) else bool(lit[i])
        rows.append(
            Position(
                model.product, **found, x_px=x, y_px=y, visible=bool(visible[i]), lit=shines, sigmas=stated, remark="",
                value=value, flags=flags,
            )
        )  # fmt: skip
    return rows


def _with_remark(row: Position, remark: str) -> Position:
    return Position(**{**row.__dict__, "remark": remark})


def _remark_of_pixel(model: PositionModel, row: Position) -> str:
    remarks = [] if row.flags is not None else ["outside of the frame"]
    if not row.visible:
        outside_raw = model.geometry.detector is not None and row.flags is None
        remarks += ["where it is in the undistorted frame is not known"] if outside_raw else ["off the body"]
    elif row.lit is False:
        remarks.append("on the night side")
    return ", ".join(remarks)


def _remark_of_place(model: PositionModel, row: Position, place_px: Array, seen: bool) -> str:
    if not np.isfinite(place_px).all():
        return "behind the camera"
    remarks = []
    if not seen:
        behind = model.geometry.target.shape is None or (row.emission_deg or 0.0) > HORIZON_DEG
        remarks.append("behind the limb" if behind else "hidden by another part of the body")
    elif row.flags is None:
        remarks.append("outside of the frame")
    if row.lit is False:
        remarks.append("on the night side")
    return ", ".join(remarks)


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
