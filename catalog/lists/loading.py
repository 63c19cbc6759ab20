"""Image lists from files, and back: every row checked, every fault named with its place."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from catalog.errors import RefusedError
from catalog.lists.model import ImageEntry, ImageList
from catalog.lists.tables import Row, invalid, read_table, write_table
from catalog.reasons import Reason

LISTS_FOLDER = Path(__file__).parent / "data"
TRUTH = "truth."
WHOLE = ("name", "title", "sources", "missing")
SHOWN_FAULTS = 8
REMEDY = "Correct these rows; `planetpose catalog check` names every fault."


def known_lists() -> dict[str, Path]:
    """The lists of the catalog by name."""
    return {path.stem: path for path in sorted(LISTS_FOLDER.glob("*.toml"))}


def find_list(name_or_file: str | Path) -> Path:
    """The file of a list: a name of the catalog, else a path. Raises RefusedError when it is neither."""
    known = known_lists()
    if str(name_or_file) in known:
        return known[str(name_or_file)]
    path = Path(name_or_file)
    if not path.exists():
        raise RefusedError(
            Reason.LIST_MISSING,
            f"image list {name_or_file} is neither a file nor in the catalog.",
            f"The catalog has {', '.join(known) or 'none'}; a list is a CSV, TOML or Parquet file.",
        )
    return path


def load_image_list(name_or_file: str | Path) -> ImageList:
    """The image list of that name or file. Raises RefusedError naming the file and, by place, up to eight faults."""
    found, faults = read_image_list(find_list(name_or_file))
    if faults:
        more = f"; and {len(faults) - SHOWN_FAULTS} more" if len(faults) > SHOWN_FAULTS else ""
        raise invalid(found.file or Path(name_or_file), "; ".join(faults[:SHOWN_FAULTS]) + more, REMEDY)
    return found


def read_image_list(path: Path) -> tuple[ImageList, list[str]]:
    """The entries of a list that are sound and unlike the earlier ones, and the faults of the others, each with its
    place. A TOML file may keep its rows in a table beside it (`rows = "x.csv"`) and may give `[defaults]` for cells
    that are empty. Raises RefusedError when the file as a whole cannot be used."""
    whole, rows = read_table(path)
    defaults, rows_file = whole.pop("defaults", {}), whole.pop("rows", None)
    if not isinstance(defaults, dict) or not isinstance(rows_file, str | None):
        raise invalid(path, "`defaults` must be a table and `rows` a file's name")
    if rows_file is not None:
        beside = path.parent / Path(rows_file).name
        rows = [*rows, *((f"{beside.name} {place}", row) for place, row in read_table(beside)[1])]
    entries, faults = sound_entries(((place, defaults | row) for place, row in rows))
    try:
        return ImageList(**({"name": path.stem} | whole), entries=tuple(entries), file=path), faults
    except (ValidationError, TypeError) as error:
        raise invalid(path, _in_words(error), f"Of the whole list may be said: {', '.join(WHOLE)}.") from error


def sound_entries(
    rows: Iterable[tuple[str, Row]], known: Iterable[ImageEntry] = ()
) -> tuple[list[ImageEntry], list[str]]:
    """Entries of the rows that are sound and repeat neither product nor file nor content of an earlier one or of
    `known`, and the others' faults, each with its place."""
    entries: list[ImageEntry] = []
    faults: list[str] = []
    first = {key: f"{entry.product!r} of the list" for entry in known for key in identities(entry)}
    for place, row in rows:
        try:
            entry = ImageEntry.model_validate(_typed(row))
        except ValidationError as error:
            faults.append(f"{place}{_product(row)}: {_in_words(error)}")
            continue
        repeated = [(kind, first[kind, value]) for kind, value in identities(entry) if (kind, value) in first]
        if repeated:
            faults.append(f"{place}{_product(row)}: the same {repeated[0][0]} as {repeated[0][1]}")
            continue
        first.update(dict.fromkeys(identities(entry), place))
        entries.append(entry)
    return entries, faults


def identities(entry: ImageEntry) -> list[tuple[str, str]]:
    """What no two entries of a list may share: product (whatever its case), file, content."""
    found = [("product", entry.product.casefold()), ("image", entry.image)]
    return found + ([("content", entry.sha256)] if entry.sha256 else [])


def _product(row: Row) -> str:
    return f" ({row['product']!r})" if row.get("product") else ""


def _typed(row: Row) -> dict[str, Any]:
    """Cells of CSV and Parquet in the model's types: lists are separated by `;`, `truth.X` columns are one table."""
    typed = {name: value for name, value in row.items() if not str(name).startswith(TRUTH)}
    if isinstance(typed.get("kernels"), str):
        typed["kernels"] = tuple(part.strip() for part in typed["kernels"].split(";") if part.strip())
    truth = {name.removeprefix(TRUTH): _number(value) for name, value in row.items() if str(name).startswith(TRUTH)}
    return typed | ({"truth": truth} if truth else {})


def _number(value: Any) -> Any:
    try:
        return float(value) if isinstance(value, str) else value
    except ValueError:
        return value


def _in_words(error: Exception) -> str:
    if not isinstance(error, ValidationError):
        return str(error)
    first = error.errors()[0]
    name = ".".join(str(part) for part in first["loc"]) or "row"
    return f"{name}: {first['msg'].removeprefix('Value error, ')}"


def write_image_list(image_list: ImageList, path: Path) -> None:
    """Write a list as CSV, TOML or Parquet, whole or not at all. CSV and Parquet leave out title, sources, missing."""
    whole = {name: value for name in WHOLE if (value := _plain(getattr(image_list, name)))}
    write_table(path, whole, [row_of(entry) for entry in image_list.entries])


def row_of(entry: ImageEntry) -> Row:
    """An entry as a row of plain values, without what is not known."""
    fields = entry.model_dump(mode="json", exclude_defaults=True, exclude={"truth"})
    return {k: _plain(v) for k, v in fields.items()} | {f"{TRUTH}{name}": value for name, value in entry.truth.items()}


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value
