"""Rows of an image list as CSV, TOML or Parquet: plain values in, plain values out, no meaning."""

import csv
import io
import os
import uuid
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from catalog.errors import RefusedError
from catalog.plain_files import read_toml_file
from catalog.reasons import Reason
from catalog.regular_file import check_regular, read_regular, read_regular_text

Row = dict[str, Any]
SUFFIXES = (".csv", ".toml", ".parquet")
MAX_FILE_BYTES = 200_000_000


def read_table(path: Path) -> tuple[Row, list[tuple[str, Row]]]:
    """What a list file says of the whole list (TOML only), and its rows, each with the place that a person finds it at.

    Empty cells are left out. Raises RefusedError naming the file, the place and the remedy.
    """
    path = Path(path)
    _check(path)
    try:
        if path.suffix.lower() == ".csv":
            return {}, _csv_rows(path)
        if path.suffix.lower() == ".toml":
            return _toml_rows(path)
        return {}, _parquet_rows(path)
    except (OSError, ValueError, csv.Error) as error:
        raise invalid(path, f"it cannot be read ({error})", "Save it as UTF-8 text.") from error


def _check(path: Path) -> None:
    if path.suffix.lower() not in SUFFIXES:
        raise invalid(path, f"its name ends in {path.suffix!r}", f"Lists end in {', '.join(SUFFIXES)}.")
    try:
        check_regular(path, MAX_FILE_BYTES)
    except FileNotFoundError as error:
        raise RefusedError(
            Reason.LIST_MISSING, f"image list {path} does not exist.", "`planetpose catalog list` names some."
        ) from error
    except OSError as error:
        raise invalid(path, f"it cannot be read ({error.strerror})", "Save it as a file and give that.") from error


def invalid(path: Path, fault: str, remedy: str = "Correct the file.") -> RefusedError:
    """The refusal of a list file."""
    return RefusedError(Reason.LIST_INVALID, f"image list {path}: {fault}.", remedy)


def _csv_rows(path: Path) -> list[tuple[str, Row]]:
    text = read_regular_text(path, MAX_FILE_BYTES, "utf-8-sig")
    lines = csv.reader(io.StringIO(text, newline=""), strict=True)
    header = [name.strip() for name in next(lines, [])]
    if not header or len(set(header)) != len(header) or "" in header:
        raise invalid(path, f"its first line must name each column once, it is {header}", "Name the columns.")
    rows = []
    for cells in lines:
        if any(cell.strip() for cell in cells):
            place = f"line {lines.line_num}"
            if len(cells) != len(header):
                raise invalid(
                    path, f"{place} has {len(cells)} cells, the first line names {len(header)}", "Count them."
                )
            rows.append((place, {k: v.strip() for k, v in zip(header, cells, strict=True) if v.strip()}))
    return rows


def _toml_rows(path: Path) -> tuple[Row, list[tuple[str, Row]]]:
    whole = read_toml_file(path, MAX_FILE_BYTES)
    images = whole.pop("image", [])
    if not isinstance(images, list) or not all(isinstance(image, dict) for image in images):
        raise invalid(path, "`image` is no list of tables", "Write one [[image]] for each image.")
    return whole, [(f"[[image]] {number}", image) for number, image in enumerate(images, 1)]


def _parquet_rows(path: Path) -> list[tuple[str, Row]]:
    import pyarrow
    import pyarrow.parquet

    try:
        rows = pyarrow.parquet.read_table(io.BytesIO(read_regular(path, MAX_FILE_BYTES))).to_pylist()
    except pyarrow.ArrowException as error:
        raise invalid(path, f"it cannot be read as Parquet ({error})", "Write it again, or save it as CSV.") from error
    kept = [{k: v for k, v in row.items() if v is not None and v != ""} for row in rows]
    return [(f"row {number}", row) for number, row in enumerate(kept, 1)]


def write_table(path: Path, whole: Mapping[str, Any], rows: Sequence[Row]) -> None:
    """Write rows by the suffix of `path`, whole or not at all. Only TOML keeps what is said of the whole list."""
    path = Path(path)
    if path.suffix.lower() not in SUFFIXES:
        raise invalid(path, f"its name ends in {path.suffix!r}", f"Lists end in {', '.join(SUFFIXES)}.")
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{uuid.uuid4().hex}{path.suffix}")
    try:
        if path.suffix.lower() == ".parquet":
            _write_parquet(temporary, rows)
        else:
            text = _csv_text(rows) if path.suffix.lower() == ".csv" else _toml_text(whole, rows)
            temporary.write_text(text, encoding="utf-8", newline="")
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def _columns(rows: Sequence[Row]) -> list[str]:
    return list(dict.fromkeys(name for row in rows for name in row))


def _csv_text(rows: Sequence[Row]) -> str:
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, _columns(rows) or ["product", "image"], lineterminator="\n")
    writer.writeheader()
    writer.writerows({k: ";".join(v) if isinstance(v, list) else v for k, v in row.items()} for row in rows)
    return text.getvalue()


def _toml_text(whole: Mapping[str, Any], rows: Sequence[Row]) -> str:
    from tomli_w import dumps

    # Not one `image = [...]`, which tomli-w makes of short rows: nobody could then add an [[image]] by hand.
    parts = [dumps(whole), *(f"[[image]]\n{dumps(row)}" for row in rows)]
    return "\n".join(part for part in parts if part)


def _write_parquet(path: Path, rows: Sequence[Row]) -> None:
    import pyarrow
    import pyarrow.parquet

    columns = _columns(rows)
    pyarrow.parquet.write_table(pyarrow.table({name: [row.get(name) for row in rows] for name in columns}), path)
