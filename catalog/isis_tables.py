"""ISIS cubes after spiceinit: the pose in their tables, and the camera in their NaifKeywords; no kernels are needed.

Tables InstrumentPointing and BodyRotation hold quaternions (J2000Q0 ... J2000Q3, ET) from J2000 to a moving frame, and
ConstantRotation from there on; InstrumentPosition is the spacecraft, SunPosition the Sun, from the target's centre in
km, J2000 (ISIS' SpiceRotation and SpicePosition). Records are fields of 8-byte reals, 4-byte integers or text.
"""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.bounded_pvl import MAX_LABEL_BYTES, load_pvl
from catalog.carried_tables import Positions, Rotations, matrix
from catalog.conditions import temperature_of_label
from catalog.errors import RefusedError
from catalog.instrument_kernel import Instrument, TablePool
from catalog.kernel_camera import content_of
from catalog.kernel_frames import DEFAULT_TOLERANCE_S, Frames, handedness_of
from catalog.pose import PartialPose
from catalog.reasons import Reason
from catalog.regular_file import open_regular

Array = NDArray[np.float64]
TABLES = ("InstrumentPointing", "BodyRotation", "InstrumentPosition", "SunPosition")
KINDS = {"DOUBLE": "f8", "REAL": "f4", "INTEGER": "i4"}
MAX_TABLE_BYTES = 50_000_000
REMEDY = "Run ISIS' spiceinit on the cube, or give kernels or a pose file."
FAULTS = (KeyError, TypeError, ValueError, IndexError, AttributeError, OverflowError)


def begins_as_cube(head: bytes) -> bool:
    """Whether a file with these first bytes is an ISIS3 cube or the detached label of one."""
    return head[:200].split()[:3] == [b"Object", b"=", b"IsisCube"]


def is_isis_cube(path: Path) -> bool:
    """Whether a file begins as an ISIS3 cube or its detached label does."""
    try:
        with open_regular(path) as file:
            return begins_as_cube(bytes(file.read(200)))
    except OSError:
        return False


def parsed_cube_label(path: Path) -> Mapping[str, Any]:
    """The label of an ISIS cube. Raises OSError or ValueError when it cannot be read."""
    with open_regular(path) as file:
        raw = bytes(file.read(MAX_LABEL_BYTES))
    label: Mapping[str, Any] = load_pvl(raw.partition(b"\0")[0].decode("latin-1"))
    return label


def has_pose(label: Mapping[str, Any]) -> bool:
    """Whether a cube's label describes the tables of spiceinit."""
    return {str(table.get("Name")) for table in _tables(label)} >= set(TABLES)


def cube_label(path: Path) -> Mapping[str, Any]:
    """The label of an ISIS cube. Raises RefusedError when it cannot be read."""
    try:
        return parsed_cube_label(path)
    except (OSError, ValueError) as error:
        raise RefusedError(Reason.ISIS_LABEL, f"cube {path}: its label cannot be read ({error}).", REMEDY) from error


def pose_from_cube(path: Path, et: float | None = None, label: Mapping[str, Any] | None = None) -> PartialPose:
    """Pose of a cube's tables at `et` (TDB seconds past J2000; None: the middle of its pointing table), with the
    velocities left out, which the tables give relative to the target only.

    Raises RefusedError naming the cube and the table that is missing or damaged.
    """
    label = cube_label(path) if label is None else label
    try:
        tables = {str(table["Name"]): table for table in _tables(label)}
        pointing = _rotations(path, tables["InstrumentPointing"])
        et = float(pointing.times.mean()) if et is None else et
        camera_from_sensor = np.array(content_from_cube(path, label)["camera_from_instrument"], dtype=np.float64)
        spacecraft = _positions(path, tables["InstrumentPosition"]).at(et)
        return PartialPose(
            et=et,
            camera_from_j2000=camera_from_sensor @ pointing.at(et),
            target_from_spacecraft_km=-spacecraft,
            sun_from_target_km=_positions(path, tables["SunPosition"]).at(et),
            body_from_j2000=_rotations(path, tables["BodyRotation"]).at(et),
        )
    except FAULTS as error:
        fault = f"it lacks the table or field {error}" if isinstance(error, KeyError) else str(error)
        raise RefusedError(Reason.ISIS_TABLES, f"cube {path}: {fault}.", REMEDY) from error


def content_from_cube(path: Path, label: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Content of a camera file for a cube's NaifKeywords, under the filter and temperature of its label.

    Raises RefusedError when the cube carries no keywords, or not enough of them.
    """
    label = cube_label(path) if label is None else label
    keywords, cube = _group(label, "NaifKeywords"), _group(label, "IsisCube")
    naif_id = _naif_id(cube, keywords)
    if not keywords or naif_id is None:
        fault = f"cube {path} carries no NaifKeywords, or no NaifFrameCode"
        raise RefusedError(Reason.ISIS_KEYWORDS, f"{fault}: spiceinit was not run.", REMEDY)
    kernel = Instrument(naif_id, _name(keywords, naif_id), TablePool(keywords, path.name))
    frames = Frames(None, None, None, DEFAULT_TOLERANCE_S, handedness_of(kernel))
    try:
        filter_name = _group(cube, "BandBin").get("FilterName")
        filter_name = filter_name if isinstance(filter_name, str) else None
        temperature_c = temperature_of_label(_group(cube, "Instrument"))
        known = kernel.number("PIXEL_SAMPLES") or kernel.number("FRAME_SAMPLES") or kernel.number("FILTER_SAMPLES")
        return content_of(kernel, frames, None, filter_name, temperature_c, None if known else _whole_size(path, cube))
    except FAULTS as error:
        fault = f"it lacks the keyword {error}" if isinstance(error, KeyError) else str(error)
        raise RefusedError(
            Reason.ISIS_KEYWORDS, f"cube {path}: its keywords make no camera ({fault}).", REMEDY
        ) from error


def _group(label: Mapping[str, Any], name: str) -> dict[str, Any]:
    """A group or object of a label; empty where it has none."""
    found = label.get(name)
    return dict(found.items()) if found is not None and hasattr(found, "items") else {}


def _whole_size(path: Path, cube: Mapping[str, Any]) -> tuple[int, int]:
    """Samples and lines of the cube before it was cropped or reduced."""
    alpha, size = _group(cube, "AlphaCube"), _group(_group(cube, "Core"), "Dimensions")
    if alpha:
        return int(alpha["AlphaSamples"]), int(alpha["AlphaLines"])
    if not size:
        raise RefusedError(Reason.ISIS_LABEL, f"cube {path}: its label has no Dimensions.", REMEDY)
    return int(size["Samples"]), int(size["Lines"])


def _tables(label: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    getall = getattr(label, "getall", None) or getattr(label, "getlist", None)
    found = getall("Table") if getall and "Table" in label else []
    return [table for table in found if hasattr(table, "items")]


def _naif_id(cube: Mapping[str, Any], keywords: Mapping[str, Any]) -> int | None:
    """The instrument's id: the filter's (NaifIkCode) where the cube has its keywords, else the camera's frame code."""
    groups = [_group(cube, name) for name in ("BandBin", "Kernels")]
    codes = [group.get(key) for key in ("NaifIkCode", "NaifFrameCode") for group in groups]
    whole = [code for code in codes if isinstance(code, int) and not isinstance(code, bool)]
    known = [code for code in whole if f"INS{code}_FOCAL_LENGTH" in keywords]
    return next(iter([*known, *_filters_of(whole, keywords), *whole]), None)


def _filters_of(codes: list[int], keywords: Mapping[str, Any]) -> list[int]:
    """The filter's id where the keywords hold the focal length of one filter of the camera only (MESSENGER WAC)."""
    found = [re.match(r"INS(-\d+)_FOCAL_LENGTH$", key) for key in keywords]
    ids = [int(match[1]) for match in found if match]
    return [each for each in ids if any(-(-each // 100) == -(-code // 100) for code in codes)]


def _name(keywords: Mapping[str, Any], naif_id: int) -> str:
    return str(keywords.get(f"FRAME_{naif_id}_NAME", naif_id))


def _records(path: Path, table: Mapping[str, Any]) -> dict[str, Array]:
    """Columns of a table by name, as float64."""
    getall = getattr(table, "getall", None) or table.getlist  # type: ignore[attr-defined]
    order = ">" if str(table.get("ByteOrder", "Lsb")).upper() == "MSB" else "<"
    fields = []
    for each in getall("Field"):
        kind, size = str(each["Type"]).upper(), int(each["Size"])
        fields.append((str(each["Name"]), f"S{size}" if kind == "TEXT" else order + KINDS[kind], (size,)))
    dtype = np.dtype(
        [(name, kind) if size == (1,) or kind[0] == "S" else (name, kind, size) for name, kind, size in fields]
    )
    records, start = int(table["Records"]), int(table["StartByte"])
    if records < 1 or start < 1 or records * dtype.itemsize > MAX_TABLE_BYTES:
        raise ValueError(f"its table {table['Name']} of {records} records at byte {start} is not read")
    with open_regular(path) as file:
        file.seek(start - 1)
        raw = bytes(file.read(records * dtype.itemsize))
    if len(raw) < records * dtype.itemsize:
        raise ValueError(f"its table {table['Name']} is cut short")
    content = np.frombuffer(raw, dtype)
    columns = {name: np.asarray(content[name], np.float64) for name, kind, _ in fields if kind[0] != "S"}
    if not all(np.isfinite(column).all() for column in columns.values()):
        raise ValueError(f"its table {table['Name']} holds values that are not finite")
    return columns


def _rotations(path: Path, table: Mapping[str, Any]) -> Rotations:
    columns = _records(path, table)
    if "J2000Q0" not in columns:
        raise ValueError(f"its table {table['Name']} holds polynomials of angles, not quaternions")
    quaternions = np.stack([columns[f"J2000Q{number}"] for number in range(4)], axis=-1)
    constant = table.get("ConstantRotation")
    numbers = None if constant is None else [float(getattr(value, "value", value)) for value in constant]
    return Rotations(columns["ET"], quaternions, matrix(numbers))


def _positions(path: Path, table: Mapping[str, Any]) -> Positions:
    columns = _records(path, table)
    place = np.stack([columns[f"J2000{axis}"] for axis in "XYZ"], axis=-1)
    names = [f"J2000{axis}V" for axis in "XYZ"]
    moving = np.stack([columns[name] for name in names], axis=-1) if set(names) <= set(columns) else None
    return Positions(columns["ET"], place, moving)
