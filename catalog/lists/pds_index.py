"""Rows of an image list from a PDS3 index: INDEX.LBL, CUMINDEX.LBL or a node's own, beside its fixed-width table."""

import csv
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from catalog.bounded_pvl import MAX_LABEL_BYTES, load_pvl
from catalog.errors import RefusedError
from catalog.lists.model import ImageEntry
from catalog.lists.tables import Row
from catalog.readers.exposure_time import Place, claim, exposure_time
from catalog.readers.label_values import number, text
from catalog.readers.names import camera_of_names, instrument_names, sole_target, targets_of_label
from catalog.reasons import Reason
from catalog.regular_file import is_regular, open_regular, read_regular
from catalog.safe_name import safe_product_name
from catalog.times import utc_from_et

MAX_ROW_BYTES = 100_000
LONGER = 5  # times an image's label
IMAGE_SUFFIX = {".LBL": ".IMG", ".lbl": ".img"}
SUFFIX_OF_CAMERA = {"newhorizons-lorri": ".fit"}
TIMES: dict[str, Place] = {
    "IMAGE_MID_TIME": "middle",
    "MID_TIME": "middle",
    "START_TIME": "start",
    "STOP_TIME": "end",
    "IMAGE_TIME": "near",
}


@dataclass(frozen=True)
class Index:
    """A parsed index label. columns: name, first byte (0-based), bytes. common: keywords that hold for all rows."""

    table: Path
    row_bytes: int
    columns: tuple[tuple[str, int, int], ...]
    common: dict[str, Any]


def table_name(path: Path) -> str:
    """The bare name of the table that an index label points to. Raises RefusedError when it points to none."""
    return _table_name(path, _parsed(path))


def _table_name(path: Path, content: Any) -> str:
    places = next((value for key, value in content.items() if re.fullmatch(r"\^\w*TABLE", str(key))), None)
    name = re.split(r"[\\/]", str(places[0] if isinstance(places, (list, tuple)) else places))[-1]
    if places is None or not re.fullmatch(r"[\w.-]{1,100}", name):
        raise unusable(path, "it points to no table", "Give the label of an index (INDEX.LBL, CUMINDEX.LBL).")
    return name


def read_index_label(path: Path) -> Index:
    """The layout of an index. Raises RefusedError when the label is no PDS3 index label or its table is not there."""
    content = _parsed(path)
    name = _table_name(path, content)
    objects = [value for key, value in content.items() if hasattr(value, "getall") and "TABLE" in str(key)]
    if not objects:
        raise unusable(path, "it describes no table", "Give the label of an index (INDEX.LBL, CUMINDEX.LBL).")
    table = objects[0]
    try:
        columns = tuple(
            (str(c["NAME"]).strip().upper(), int(c["START_BYTE"]) - 1, int(c["BYTES"])) for c in table.getall("COLUMN")
        )
        row_bytes = int(table.get("ROW_BYTES") or content["RECORD_BYTES"])
    except (KeyError, TypeError, ValueError) as error:
        raise unusable(path, f"a column lacks {error}") from error
    if not 0 < row_bytes <= MAX_ROW_BYTES or any(start < 0 or size < 1 for _, start, size in columns):
        raise unusable(path, f"its rows have {row_bytes} bytes and its columns {columns[:3]} ...")
    common = {str(k): v for k, v in content.items() if isinstance(v, str)}
    return Index(_beside(path, name), row_bytes, columns, common)


def unusable(path: Path, fault: str, remedy: str = "Fetch label and table again.") -> RefusedError:
    """The refusal of an index."""
    return RefusedError(Reason.INDEX_INVALID, f"index {path}: {fault}.", remedy)


def _parsed(path: Path) -> Any:
    if not is_regular(path) or path.stat().st_size > LONGER * MAX_LABEL_BYTES:
        raise unusable(path, "there is no label of a sane size", "Check the path.")
    try:
        return load_pvl(read_regular(path).decode("latin-1"), LONGER)
    except ValueError as error:
        raise unusable(path, str(error)) from error


def _beside(label: Path, name: str) -> Path:
    """The table, by its bare name whatever its case."""
    for path in sorted(label.parent.iterdir()):
        if path.name.casefold() == name.casefold() and is_regular(path):
            return path
    raise unusable(label, f"its table {name!r} is not beside it")


def index_rows(index: Index) -> Iterator[tuple[str, Row]]:
    """Every row as stripped text by column, with its place. Raises RefusedError when the table is cut short."""
    with open_regular(index.table) as file:
        line = 0
        while raw := file.read(index.row_bytes):
            line += 1
            if len(raw) < index.row_bytes and not raw.endswith((b"\n", b"\r")):
                raise unusable(index.table, f"row {line} is cut off after {len(raw)} of {index.row_bytes} bytes")
            cells = raw.decode("latin-1")
            yield f"row {line}", {name: _cell(cells[start : start + size]) for name, start, size in index.columns}


def _cell(raw: str) -> str:
    return next(csv.reader([raw.strip()]), [""])[0].strip() if '"' in raw else raw.strip()


def index_entries(label: Path, base: str | None, target: str | None, camera: str | None) -> Iterator[tuple[str, Row]]:
    """Rows of an image list for the index's rows that show `target` by `camera` (None: all), each with its place.

    base: what volume and path are appended to, such as `pds-rings:volumes/VGISS_5xxx`; None means the volume on this
    disk, of which the index is a part.
    """
    index = read_index_label(label)
    for place, cells in index_rows(index):
        row = _entry(index.common | cells, base if base else str(label.resolve().parent.parent), base is not None)
        if target in (None, row.get("target")) and camera in (None, row.get("camera")):
            yield f"{label.name} {place}", row


def _entry(cells: dict[str, Any], base: str, with_volume: bool) -> Row:
    path = cells.get("FILE_SPECIFICATION_NAME") or f"{cells.get('PATH_NAME', '')}/{cells.get('FILE_NAME', '')}"
    parts = [part for part in path.replace("\\", "/").split("/") if part]
    volume = str(cells.get("VOLUME_ID", "")).strip()
    if with_volume and volume and parts[:1] != [volume]:
        parts.insert(0, volume)
    camera = camera_of_names(instrument_names(cells))
    label, suffix = None, Path(parts[-1]).suffix if parts else ""
    whole = "/".join([base.rstrip("/"), *parts])
    if suffix in IMAGE_SUFFIX:
        label = whole
        whole = whole.removesuffix(suffix) + SUFFIX_OF_CAMERA.get(camera or "", IMAGE_SUFFIX[suffix])
    seconds = number(cells, "EXPOSURE_DURATION")
    found = {
        "product": safe_product_name(Path(parts[-1]).stem if parts else ""),
        "image": whole,
        "label": label,
        "camera": camera,
        "target": sole_target(targets_of_label(cells.get("TARGET_NAME"))),
        "utc": _utc(cells),
        "exposure_s": seconds if seconds is None or seconds >= 0 else None,
        "filter": text(cells, "FILTER_NAME"),
    }
    return {key: value for key, value in found.items() if value is not None and key in ImageEntry.model_fields}


def _utc(cells: dict[str, Any]) -> str | None:
    claims = [stated for key, place in TIMES.items() for stated in claim(key, text(cells, key), place)]
    found = exposure_time(claims, {})
    return None if found.et is None else utc_from_et(found.et)
