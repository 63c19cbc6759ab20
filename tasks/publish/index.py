"""The store's index: one table of all images, `index.parquet`, that every reader of Parquet opens with one call.

The cubes are the truth, the index is a copy: it is compared with them whenever it is opened here, rows of new or
changed products are read anew, and the file is exchanged as a whole. Nothing is lost when a writer dies, and of several
writers, which a file lock puts in order, the last one has seen all that the others published.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from catalog.errors import RefusedError
from catalog.plain_text import printable
from catalog.reasons import Reason
from catalog.safe_name import INDEX
from tasks.atomic import file_put_in_place, locked
from tasks.publish.cube import open_cube
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
        index = _brought_up_to_date(store, read_index(store), product_stamps(store))
        if writable:
            _write(index, store)
    return index


def rebuild_index(store: Path) -> "pd.DataFrame":
    """The same, with every row read from its cube, and no regard for what the file said."""
    store = _existing(store)
    with _writing(store) as writable:
        index = _brought_up_to_date(store, None, product_stamps(store))
        if writable:
            _write(index, store)
    return index


def open_store(store: Path) -> "xr.DataTree":
    """All cubes of a store as one tree, one node per product, lazy: dask arrays."""
    import xarray as xr

    index = open_index(store)
    readable = index[index["status"] != UNREADABLE]
    cubes = zip(readable["product"], readable["cube"], strict=True)
    return xr.DataTree.from_dict({product: open_cube(Path(store) / cube) for product, cube in cubes})


def read_index(store: Path) -> "pd.DataFrame | None":
    """The index as the file has it; None when there is none, it is damaged, or another version wrote it."""
    import pandas as pd
    from pyarrow.lib import ArrowException

    try:
        index = pd.read_parquet(Path(store) / INDEX)
    except (OSError, ValueError, ArrowException):
        return None
    return index if tuple(index.columns) == NAMES else None


def product_stamps(store: Path) -> dict[str, str]:
    """The stamp of every product in the store, by name."""
    folders = sorted(path for path in Path(store).iterdir() if not path.name.startswith("."))
    return {printable(path.name): stamp for path in folders if (stamp := stamp_of(path)) is not None}


def table_of(rows: list[dict[str, Any]]) -> "pd.DataFrame":
    """Rows as a table whose columns have the same types whatever is known."""
    import pandas as pd

    table = pd.DataFrame(rows, columns=list(NAMES))
    types = {"text": "str", "number": "float64", "whole": "Int64"}
    table["utc"] = pd.to_datetime(table["utc"], utc=True, format="ISO8601").astype("datetime64[us, UTC]")
    table = table.astype({column.name: types[column.kind] for column in COLUMNS if column.kind in types})
    return table.sort_values(["et", "product"], ignore_index=True)


def _agrees(index: "pd.DataFrame", stamps: dict[str, str]) -> bool:
    return dict(zip(index["product"], index["stamp"], strict=True)) == stamps


def _brought_up_to_date(store: Path, known: "pd.DataFrame | None", stamps: dict[str, str]) -> "pd.DataFrame":
    """Rows whose stamp is still true are kept, all others read."""
    import pandas as pd

    if known is None:
        return table_of([row_of(store / name, stamp) for name, stamp in stamps.items()])
    kept = known[[stamps.get(name) == stamp for name, stamp in zip(known["product"], known["stamp"], strict=True)]]
    there = set(kept["product"])
    new = [row_of(store / name, stamp) for name, stamp in stamps.items() if name not in there]
    parts = [part for part in (kept, table_of(new)) if len(part)]
    table = pd.concat(parts) if parts else table_of([])
    return table.sort_values(["et", "product"], ignore_index=True)


def _write(index: "pd.DataFrame", store: Path) -> None:
    with file_put_in_place(store / INDEX) as temporary:
        index.to_parquet(temporary, index=False)


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
