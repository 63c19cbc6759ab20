"""The store's index: one table of all images, `index.parquet`, that every reader of Parquet opens with one call.

The cubes are the truth, the index is a copy: it is compared with them whenever it is opened here, rows of new or
changed products are read anew, and the files that hold them are exchanged (see `index_parts`). Nothing is lost when a
writer dies, and of several writers, which a file lock puts in order, the last one has seen all that the others
published. Who knows what was published needs no comparison: `update_index`.
"""

import os
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from catalog.errors import RefusedError
from catalog.plain_text import printable
from catalog.reasons import Reason
from catalog.safe_name import INDEX
from tasks.atomic import locked
from tasks.publish.cube import open_cube
from tasks.publish.index_parts import (
    ORDER,
    count_rows,
    products_of_parts,
    read_whole,
    stamps_of_parts,
    write_rows,
    write_whole,
)
from tasks.publish.index_rows import COLUMNS, NAMES, UNREADABLE, row_of, stamp_of

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

LOCK = ".index.lock"


def open_index(store: Path) -> "pd.DataFrame":
    """The index of a store (see `index_rows.COLUMNS`), in the order of time, brought up to date and written when it
    was not; a store that is empty or cannot be written to gets its index in memory. Raises RefusedError when there is
    no store."""
    store = _existing(store)
    known = read_index(store)
    stamps = product_stamps(store)
    if not stamps and known is None:
        return table_of([])
    if known is not None and _agrees(known, stamps):
        return known
    with _writing(store) as writable:
        known, stamps = read_index(store), product_stamps(store)
        if known is not None and _agrees(known, stamps):  # another writer was quicker
            return known
        index, rows = _brought_up_to_date(store, known, stamps)
        if writable:
            parts = products_of_parts(store)
            if known is None or parts is None or 2 * len(rows) > len(index):
                write_whole(store, index)
            else:
                write_rows(store, parts, rows, set(known["product"]) - stamps.keys())
    return index


def index_all(store: Path) -> int:
    """The same for who needs no rows: returns how many there are. Where the index is up to date, its products and
    stamps alone are read, without pandas."""
    stamps = product_stamps(_existing(store))
    known = stamps_of_parts(store)
    return len(stamps) if stamps and known == stamps else len(open_index(store))


def rebuild_index(store: Path) -> "pd.DataFrame":
    """The same, with every row read from its cube, and no regard for what the file said."""
    store = _existing(store)
    with _writing(store) as writable:
        index, _ = _brought_up_to_date(store, None, product_stamps(store))
        if writable:
            write_whole(store, index)
    return index


def update_index(store: Path, products: Collection[str]) -> int:
    """Bring the rows of these products up to date, which were published or deleted just now, and look at no other one;
    a store whose index is missing or damaged gets a whole one. Returns how many rows there are then, 0 where the store
    cannot be written to. Raises RefusedError when there is no store."""
    store = _existing(store)
    with _writing(store) as writable:
        parts = products_of_parts(store) if writable else None
        if parts is not None:
            stamps = {name: stamp_of(store / name) for name in products}
            rows = table_of([row_of(store / name, stamp) for name, stamp in stamps.items() if stamp is not None])
            write_rows(store, parts, rows, [name for name, stamp in stamps.items() if stamp is None])
            return count_rows(store)
    return len(open_index(store)) if writable else 0


def open_store(store: Path) -> "xr.DataTree":
    """All cubes of a store as one tree, one node per product, lazy: dask arrays."""
    import xarray as xr

    index = open_index(store)
    readable = index[index["status"] != UNREADABLE]
    cubes = zip(readable["product"], readable["cube"], strict=True)
    return xr.DataTree.from_dict({product: open_cube(Path(store) / cube) for product, cube in cubes})


def read_index(store: Path) -> "pd.DataFrame | None":
    """The index as its files have it; None when there is none, it is damaged, or another version wrote it. Of several
    parts those that can be read."""
    return read_whole(store)


def product_stamps(store: Path) -> dict[str, str]:
    """The stamp of every product in the store, by name."""
    names = sorted(product_folders(store))
    return {printable(name): stamp for name in names if (stamp := stamp_of(os.path.join(store, name))) is not None}


def product_folders(store: Path) -> Iterator[str]:
    """Names of what may be a product: folders that are not hidden, and no index; nothing in them is looked at."""
    with os.scandir(store) as entries:
        for entry in entries:
            if entry.name[0] != "." and entry.name != INDEX and entry.is_dir():
                yield entry.name


def table_of(rows: list[dict[str, Any]]) -> "pd.DataFrame":
    """Rows as a table whose columns have the same types whatever is known."""
    import pandas as pd

    table = pd.DataFrame(rows, columns=list(NAMES))
    types = {"text": "str", "number": "float64", "whole": "Int64"}
    table["utc"] = pd.to_datetime(table["utc"], utc=True, format="ISO8601").astype("datetime64[us, UTC]")
    table = table.astype({column.name: types[column.kind] for column in COLUMNS if column.kind in types})
    return table.sort_values(ORDER, ignore_index=True)


def _agrees(index: "pd.DataFrame", stamps: dict[str, str]) -> bool:
    return len(index) == len(stamps) and dict(zip(index["product"], index["stamp"], strict=True)) == stamps


def _brought_up_to_date(
    store: Path, known: "pd.DataFrame | None", stamps: dict[str, str]
) -> "tuple[pd.DataFrame, pd.DataFrame]":
    """All rows, and those of them that were read just now: others, whose stamp is still true, are kept."""
    import pandas as pd

    if known is None:
        index = table_of([row_of(store / name, stamp) for name, stamp in stamps.items()])
        return index, index
    kept = known[[stamps.get(name) == stamp for name, stamp in zip(known["product"], known["stamp"], strict=True)]]
    kept = kept.drop_duplicates("product")
    there = set(kept["product"])
    new = table_of([row_of(store / name, stamp) for name, stamp in stamps.items() if name not in there])
    parts = [part for part in (kept, new) if len(part)]
    table = pd.concat(parts) if parts else table_of([])
    return table.sort_values(ORDER, ignore_index=True), new


@contextmanager
def _writing(store: Path) -> Iterator[bool]:
    """Whether the store can be written to; nobody else writes its index meanwhile."""
    try:
        lock = (store / LOCK).open("a")
    except OSError:  # a read-only disk or somebody else's folder
        yield False
        return
    with lock, locked(lock):
        yield True


def _existing(store: Path) -> Path:
    store = Path(store)
    if not store.is_dir():
        raise RefusedError(Reason.STORE_MISSING, f"there is no store {store}.", "Give the folder that products are in.")
    return store
