"""Text kernels: frames and camera geometry, the clock, radii, and meta-kernels."""

import textwrap
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from catalog.camera import Camera
from catalog.target import Target
from tasks.kernels.names import (
    CLOCK_ID,
    CLOCK_NAME,
    camera_frame,
    camera_frame_id,
    craft_id,
    craft_name,
    is_built_in,
    target_frame,
    target_frame_id,
)

WIDTH = 78
LONGEST_TEXT = 70  # SPICE's strings end at 80 characters; longer ones are continued
TICKS_PER_S, FIRST_ET = 1_000_000, -1_600_000_000.0  # the clock counts microseconds of TDB from 1949


def write_text_kernel(path: Path, architecture: str, comment: Iterable[str], values: dict[str, Any]) -> None:
    """Write `values` under a comment. A key that ends in `+` appends; strings, numbers and sequences of them."""
    lines = [f"KPL/{architecture}", "", *wrapped(comment), "", "\\begindata", ""]
    for key, value in values.items():
        name, sign = (key[:-1], "+=") if key.endswith("+") else (key, "=")
        items = value if isinstance(value, list | tuple) else [value]
        lines.append(f"   {name} {sign} (")
        lines += [f"      {part}" for item in items for part in _literal(item)]
        lines.append("   )")
    path.write_text("\n".join([*lines, "", "\\begintext", ""]), encoding="ascii", errors="replace")


def wrapped(comment: Iterable[str]) -> list[str]:
    """Lines of at most 78 printable ASCII characters."""
    plain = (line.encode("ascii", "replace").decode().replace("\\begin", "begin") for line in comment)
    return [part for line in plain for part in (textwrap.wrap(line, WIDTH, subsequent_indent="   ") or [""])]


def _literal(value: Any) -> list[str]:
    if not isinstance(value, str):
        return [f"{value:d}" if isinstance(value, int) else f"{float(value):.17g}"]
    parts = [value[i : i + LONGEST_TEXT] for i in range(0, len(value), LONGEST_TEXT)] or [""]
    quoted = [part.replace("'", "''") for part in parts]
    return [f"'{part}+'" for part in quoted[:-1]] + [f"'{quoted[-1]}'"]


def frame_values(cameras: Sequence[Camera], targets: Sequence[Target]) -> dict[str, Any]:
    """FK: the cameras' frames with their pinhole geometry and field of view, and frames of bodies new to SPICE."""
    values: dict[str, Any] = {}
    names: list[str] = []
    codes: list[int] = []
    for camera in cameras:
        values |= _camera_values(camera)
        named = {camera_frame(camera): -camera_frame_id(camera)}
        own = craft_name(camera)
        named |= {own: craft_id(camera)} if own else {}
        names, codes = names + list(named), codes + list(named.values())
    for target in targets:
        names, codes = [*names, target.name.upper()], [*codes, target.naif_id]
        if not is_built_in(target):
            number, name = target_frame_id(target), target_frame(target)
            values |= _frame(name, number, 2, target.naif_id, target.naif_id)
            values[f"OBJECT_{target.naif_id}_FRAME"] = name
    return {"NAIF_BODY_NAME+": names, "NAIF_BODY_CODE+": codes} | values


def _frame(name: str, number: int, frame_class: int, class_id: int, centre: int) -> dict[str, Any]:
    return {
        f"FRAME_{name}": number,
        f"FRAME_{number}_NAME": name,
        f"FRAME_{number}_CLASS": frame_class,
        f"FRAME_{number}_CLASS_ID": class_id,
        f"FRAME_{number}_CENTER": centre,
    }


def _camera_values(camera: Camera) -> dict[str, Any]:
    name, number = camera_frame(camera), camera_frame_id(camera)
    nx, ny = camera.size_px
    corners = np.array([[0, 0], [nx, 0], [nx, ny], [0, ny]]) - 0.5
    return _frame(name, number, 3, -number, craft_id(camera)) | {
        f"CK_-{number}_SCLK": CLOCK_ID,
        f"CK_-{number}_SPK": craft_id(camera),
        f"INS-{number}_NAME": name,
        f"INS-{number}_FOV_FRAME": name,
        f"INS-{number}_FOV_SHAPE": "RECTANGLE",
        f"INS-{number}_FOV_CLASS_SPEC": "CORNERS",
        f"INS-{number}_BORESIGHT": [0.0, 0.0, 1.0],
        f"INS-{number}_FOV_BOUNDARY_CORNERS": _symmetric_corners(camera, corners),
        f"INS-{number}_PIXEL_SAMPLES": nx,
        f"INS-{number}_PIXEL_LINES": ny,
        f"INS-{number}_CENTRE_PX": list(camera.centre_px),
        f"INS-{number}_FOCAL_LENGTH_PX": camera.focal_length_px,
    }


def _symmetric_corners(camera: Camera, corners: np.ndarray) -> list[float]:
    return [float(v) for v in camera.ray(corners).ravel()]


def clock_values() -> dict[str, Any]:
    """SCLK: microseconds of TDB, so that no leap seconds are needed. SPICE's own tick is then one microsecond."""
    n, seconds = -CLOCK_ID, 4_000_000_000
    return {
        f"SCLK_DATA_TYPE_{n}": 1,
        f"SCLK01_TIME_SYSTEM_{n}": 1,
        f"SCLK01_N_FIELDS_{n}": 2,
        f"SCLK01_MODULI_{n}": [seconds, TICKS_PER_S],
        f"SCLK01_OFFSETS_{n}": [0, 0],
        f"SCLK01_OUTPUT_DELIM_{n}": 1,
        f"SCLK_PARTITION_START_{n}": 0.0,
        f"SCLK_PARTITION_END_{n}": float(seconds) * TICKS_PER_S,
        f"SCLK01_COEFFICIENTS_{n}": [0.0, FIRST_ET, 1.0],
        "NAIF_BODY_NAME+": CLOCK_NAME,
        "NAIF_BODY_CODE+": CLOCK_ID,
    }


def radii_values(targets: Sequence[Target]) -> dict[str, Any]:
    """PCK: the radii that latitudes, longitudes and angles were computed on."""
    return {f"BODY{target.naif_id}_RADII": list(target.radii_km) for target in targets}


def meta_values(folder: Path, names: Sequence[str]) -> dict[str, Any]:
    """MK: files of `folder`, in the order of loading."""
    return {
        "PATH_VALUES": str(folder),
        "PATH_SYMBOLS": "SET",
        "KERNELS_TO_LOAD": [f"$SET/{name}" for name in names],
    }
