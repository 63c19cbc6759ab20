"""The files of a store's index: one Parquet file of a small store; of a large one a folder of the same name with
`part-00000.parquet` and so on, none of more than PART_ROWS rows, which readers of Parquet open as one table.

A product has one row in one part. A changed row is exchanged in its part, a new one comes into the last part, so that
what is written for one product does not grow with the store. Every part is exchanged as a whole: a writer that dies
leaves an index without a part of its rows' changes, and never one that is half written or has a product twice.
"""

import logging
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from catalog.safe_name import INDEX
from tasks.atomic import file_put_in_place, put_in_place_of_any
from tasks.publish.index_rows import NAMES

if TYPE_CHECKING:
    import pandas as pd

# Rows of a part. Choice: writing so many takes 0.05 s of a processor (3 MB), and a million of them are fifty files.
PART_ROWS = 20_000
PART = "part-{:05d}.parquet"
ORDER = ["et", "product"]

logger = logging.getLogger("planetpose")


def part_paths(store: Path) -> list[Path]:
    """The files of the index, in order; none where there is no index."""
    path = Path(store) / INDEX
    return sorted(path.glob("part-*.parquet")) if path.is_dir() else [path] if path.exists() else []


def read_part(path: Path, columns: list[str] | None = None) -> "pd.DataFrame | None":
    """A part's rows, or some columns of them; None when it is damaged, or another version wrote it."""
    import pandas as pd
    from pyarrow import parquet
    from pyarrow.lib import ArrowException

    try:
        if tuple(parquet.read_schema(path).names) != NAMES:
            return None
        return pd.read_parquet(path, columns=columns)
    except (OSError, ValueError, ArrowException):
        return None


def read_whole(store: Path) -> "pd.DataFrame | None":
    """All rows of the parts that can be read, in the order of time; None when there is none."""
    import pandas as pd

    sound = [part for path in part_paths(store) if (part := read_part(path)) is not None]
    if not sound:
        return None
    if len(sound) == 1:
        return sound[0]
    filled = [part for part in sound if len(part)]
    return pd.concat(filled).sort_values(ORDER, ignore_index=True) if filled else sound[0]


def products_of_parts(store: Path) -> dict[Path, list[str]] | None:
    """The products of every part; None when there is no part, or one that cannot be read."""
    paths = part_paths(store)
    parts = {path: read_part(path, ["product"]) for path in paths}
    names = {path: list(part["product"]) for path, part in parts.items() if part is not None}
    return names if names and len(names) == len(paths) else None


def stamps_of_parts(store: Path) -> dict[str, str] | None:
    """The stamp of every product, as the index has it; None where a part cannot be read, or a product has two rows."""
    from pyarrow import parquet
    from pyarrow.lib import ArrowException

    pairs: list[tuple[str, str]] = []
    try:
        for path in part_paths(store):
            with parquet.ParquetFile(path) as file:  # `read_table` imports pandas
                if tuple(file.schema_arrow.names) != NAMES:
                    return None
                part = file.read(columns=["product", "stamp"])
            pairs += zip(part["product"].to_pylist(), part["stamp"].to_pylist(), strict=True)
    except (OSError, ValueError, ArrowException):
        return None
    return stamps if len(stamps := dict(pairs)) == len(pairs) else None


def count_rows(store: Path) -> int:
    """How many rows the index has, by the ends of its files."""
    from pyarrow import parquet

    return sum(parquet.read_metadata(path).num_rows for path in part_paths(store))


def write_rows(store: Path, parts: dict[Path, list[str]], rows: "pd.DataFrame", gone: Collection[str] = ()) -> None:
    """Put `rows` in the place of those of the same products, or at the end, and take out those of `gone`. parts: as
    `products_of_parts`. Nobody else may write meanwhile."""
    import pandas as pd

    leaving, seen = set(gone) | set(rows["product"]), set[str]()
    for path, names in parts.items():
        there = set(names)
        wrong = there & (leaving | seen)
        if wrong:
            part = read_part(path)
            kept = [] if part is None else [part[~part["product"].isin(wrong)]]
            ours = rows[rows["product"].isin(there - seen)]
            _write_part(pd.concat([*kept, ours]) if len(ours) else kept[0], path)
        seen |= there
    new = rows[~rows["product"].isin(seen)]
    if len(new):
        _append(store, list(parts), new)


def _append(store: Path, paths: list[Path], new: "pd.DataFrame") -> None:
    """Fill the last part, and begin others."""
    import pandas as pd

    last = read_part(paths[-1])
    filled = new if last is None or not len(last) else pd.concat([last, new])
    if paths[-1].name == INDEX and len(filled) > PART_ROWS:
        write_whole(store, filled.sort_values(ORDER, ignore_index=True))
        return
    number = len(paths) - 1 if paths[-1].name == INDEX else int(paths[-1].stem.removeprefix("part-"))
    for place, part in enumerate(_slices(filled)):
        _write_part(part, paths[-1] if place == 0 else paths[-1].with_name(PART.format(number + place)))


def write_whole(store: Path, index: "pd.DataFrame") -> None:
    """Write all rows, as one file or a folder of parts, in place of whatever is there."""
    path = Path(store) / INDEX
    if len(index) <= PART_ROWS and not path.is_dir():
        _write_part(index, path)
        return
    was_one_file = path.is_file()
    with put_in_place_of_any(path) as temporary:
        if len(index) <= PART_ROWS:
            index.to_parquet(temporary, index=False)
        else:
            temporary.mkdir()
            for number, part in enumerate(_slices(index)):
                part.to_parquet(temporary / PART.format(number), index=False)
    if was_one_file:
        said = "%s: the index of %d images is a folder of %d files now; readers of Parquet open it as one table"
        logger.warning(said, path, len(index), -(-len(index) // PART_ROWS))


def _slices(index: "pd.DataFrame") -> "Iterator[pd.DataFrame]":
    for first in range(0, len(index), PART_ROWS):
        yield index.iloc[first : first + PART_ROWS]


def _write_part(part: "pd.DataFrame", path: Path) -> None:
    with file_put_in_place(path) as temporary:
        part.sort_values(ORDER, ignore_index=True).to_parquet(temporary, index=False)
