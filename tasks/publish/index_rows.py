"""One row of the store's index: what a product says of itself, gathered from its cube's attributes and its result."""

import os
from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from stat import S_ISREG
from typing import Any

import numpy as np

from catalog.camera import Camera, camera_from_dict
from catalog.errors import RefusedError
from catalog.plain_files import own_json
from catalog.plain_text import printable
from catalog.pose import Pose
from catalog.regular_file import read_regular_text
from catalog.target import Target
from tasks.project.points import latitude_longitude
from tasks.publish.contained import DAMAGE, damage_refused, refuse_what_is_elsewhere
from tasks.publish.names import CUBE, OVERLAY, RESULT

GROUP = f"{CUBE}/zarr.json"  # of Zarr v3: the group's attributes are in there as JSON
UNREADABLE = "unreadable"


@dataclass(frozen=True)
class Column:
    """One column: its name with its unit, kind (text, number, whole, time) and meaning."""

    name: str
    kind: str
    meaning: str


COLUMNS = (
    Column("product", "text", "name of the product, and of its folder in the store"),
    Column("status", "text", f"verdict: `ok`, `doubtful`, or `{UNREADABLE}` when the cube's metadata cannot be read"),
    Column("reason", "text", "why it is not ok"),
    Column("utc", "time", "middle of the exposure, UTC"),
    Column("et", "number", "the same, TDB seconds past J2000"),
    Column("camera", "text", "camera"),
    Column("target", "text", "target"),
    Column("sub_observer_latitude_deg", "number", "planetocentric latitude below the spacecraft"),
    Column("sub_observer_longitude_deg", "number", "east longitude below the spacecraft, 0-360"),
    Column("sub_solar_latitude_deg", "number", "planetocentric latitude below the Sun"),
    Column("sub_solar_longitude_deg", "number", "east longitude below the Sun, 0-360"),
    Column("phase_deg", "number", "phase angle at the target's centre"),
    Column("range_km", "number", "spacecraft to the target's centre"),
    Column("resolution_km", "number", "size of an undistorted pixel on the surface below the spacecraft"),
    Column("radius_px", "number", "mean radius of the disk"),
    Column("centre_x_px", "number", "x of the target's centre, corrected; undistorted frame, 0-based"),
    Column("centre_y_px", "number", "y of it"),
    Column("centre_x_uncertainty_px", "number", "1-sigma"),
    Column("centre_y_uncertainty_px", "number", "1-sigma"),
    Column("offset_x_px", "number", "corrected minus predicted centre, x"),
    Column("offset_y_px", "number", "the same, y"),
    Column("range_factor", "number", "corrected by predicted distance"),
    Column("range_factor_uncertainty", "number", "1-sigma"),
    Column("attitude_deg", "number", "angle by which the body was turned; NaN when the image cannot tell"),
    Column("attitude_uncertainty_deg", "number", "1-sigma, the largest of the three axes"),
    Column("limb_rms_px", "number", "shifts between image and simulation on the lit limb"),
    Column("limb_points", "whole", "on how many segments of the limb"),
    Column("limb_robust_px", "number", "shifts across the lit limb, single segments that are far off clipped"),
    Column("limb_disagreeing", "number", "share of the segments that are more than 1 px off (validate.disagree_px)"),
    Column("similarity_before", "number", "structural similarity of image and simulation, predicted pose"),
    Column("similarity_after", "number", "the same, corrected pose"),
    Column("stars", "whole", "identified stars that the camera's orientation is by; 0 without"),
    Column("target_offset_x_px", "number", "observed less computed place of the target, x, by stars"),
    Column("target_offset_y_px", "number", "the same, y"),
    Column("pose_source", "text", "where the camera's orientation came from: `spice`, `label`, `file` or `image`"),
    Column("profile", "text", "profile of settings"),
    Column("pixel_space", "text", "`resampled` (undistorted frame) or `sensor` (the detector's own pixels)"),
    Column("image_sha256", "text", "of the source file"),
    Column("software", "text", "program and version that wrote the cube"),
    Column("cube", "text", "path of the cube, relative to the store"),
    Column("overlay", "text", "path of the picture, relative to the store"),
    Column("stamp", "text", "size and time of the files that the row was read from: how a changed product is noticed"),
)
KINDS = {column.name: column.kind for column in COLUMNS}
NAMES = tuple(column.name for column in COLUMNS)


def stamp_of(folder: str | Path) -> str | None:
    """Size and time of what a row is read from; None when the folder holds no cube."""
    try:
        stats = [os.stat(os.path.join(folder, GROUP))]
    except OSError:
        return None
    try:
        result = os.stat(os.path.join(folder, RESULT))
    except OSError:
        result = None
    if result is not None and S_ISREG(result.st_mode):
        stats.append(result)
    return " ".join(f"{stat.st_size}:{stat.st_mtime_ns}" for stat in stats)


def row_of(folder: Path, stamp: str) -> dict[str, Any]:
    """The row of the product in `folder`, by column; None where nothing is known."""
    row: dict[str, Any] = dict.fromkeys(NAMES)
    row |= {"product": folder.name, "cube": f"{folder.name}/{CUBE}", "overlay": f"{folder.name}/{OVERLAY}"}
    row["stamp"] = stamp
    try:
        refuse_what_is_elsewhere(folder)
        return row | _as_columns(_read(folder))
    except RefusedError as error:
        return row | {"status": UNREADABLE, "reason": error.reason}
    except DAMAGE as error:
        return row | {"status": UNREADABLE, "reason": printable(damage_refused(folder, error).reason)}


def _as_columns(values: dict[str, Any]) -> dict[str, Any]:
    """Values in the types of their columns. Raises ValueError or TypeError for those that are of another kind: one of
    them would spoil the whole table."""
    return {name: value if value is None else TYPES[KINDS[name]](value) for name, value in values.items()}


def _time(value: Any) -> str:
    datetime.fromisoformat(str(value))
    return str(value)


def _text(value: Any) -> str:
    return printable(str(value))


TYPES: dict[str, Callable[[Any], Any]] = {"text": _text, "number": float, "whole": int, "time": _time}


def _read(folder: Path) -> dict[str, Any]:
    attributes = own_json(read_regular_text(folder / GROUP))["attributes"]
    result = own_json(read_regular_text(folder / RESULT)) if (folder / RESULT).is_file() else {}
    pose = Pose.from_dict(own_json(attributes["pose_after"]))
    camera = camera_from_dict(own_json(attributes["camera_model"]), f"of the cube in {folder}")
    target = Target.model_validate(own_json(attributes["target_model"]))
    image = own_json(attributes["provenance"]).get("image")
    return {
        **{name: attributes[name] for name in ("utc", "et", "camera", "target", "pixel_space")},
        "software": attributes["source"],
        "image_sha256": image.get("sha256") if isinstance(image, dict) else None,
        "status": result.get("status") or "ok",
        "reason": result.get("reason"),
        **_geometry(pose, camera, target),
        **_correction(result),
    }


def _geometry(pose: Pose, camera: Camera, target: Target) -> dict[str, Any]:
    spacecraft, sun = pose.spacecraft_in_body_km, pose.body_from_j2000 @ pose.sun_from_target_km
    (observer_lat, solar_lat), (observer_lon, solar_lon) = latitude_longitude(np.stack([spacecraft, sun]))
    surface_km = pose.range_km * (1 - 1 / np.linalg.norm(spacecraft / np.asarray(target.radii_km)))
    centre = camera.project(pose.target_in_camera_km)
    return {
        "sub_observer_latitude_deg": float(observer_lat),
        "sub_observer_longitude_deg": float(observer_lon),
        "sub_solar_latitude_deg": float(solar_lat),
        "sub_solar_longitude_deg": float(solar_lon),
        "phase_deg": pose.phase_deg,
        "range_km": pose.range_km,
        "resolution_km": float(surface_km / camera.focal_length_px),
        "radius_px": target.mean_radius_km / pose.range_km * camera.focal_length_px,
        "centre_x_px": float(centre[0]),
        "centre_y_px": float(centre[1]),
    }


def _correction(result: dict[str, Any]) -> dict[str, Any]:
    """What `result.json` adds to the cube; nothing when it says nothing."""
    sigma = result.get("uncertainty") or {}
    centre_sigma = sigma.get("centre_px") or sigma.get("offset_px") or (None, None)
    offset = result.get("offset_px") or (None, None)
    turn, turn_sigma = result.get("attitude_deg"), sigma.get("attitude_deg")
    similarity, stars = result.get("similarity") or {}, result.get("stars") or {}
    apart = stars.get("target_offset_px") or (None, None)
    return {
        "centre_x_uncertainty_px": centre_sigma[0],
        "centre_y_uncertainty_px": centre_sigma[1],
        "offset_x_px": offset[0],
        "offset_y_px": offset[1],
        "range_factor": result.get("range_factor"),
        "range_factor_uncertainty": sigma.get("range_factor"),
        "attitude_deg": None if turn is None else float(np.linalg.norm(turn)),
        "attitude_uncertainty_deg": max(turn_sigma) if turn_sigma else None,
        "limb_rms_px": result.get("limb_rms_px"),
        "limb_points": result.get("limb_points"),
        "limb_robust_px": result.get("limb_robust_px"),
        "limb_disagreeing": result.get("limb_disagreeing"),
        "similarity_before": similarity.get("before"),
        "similarity_after": similarity.get("after"),
        "stars": stars.get("stars", 0),
        "target_offset_x_px": apart[0],
        "target_offset_y_px": apart[1],
        "pose_source": result.get("pose_source"),
        "profile": result.get("profile"),
    }
