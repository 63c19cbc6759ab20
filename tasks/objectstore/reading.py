"""Read a store in object storage: its whole products, one of them as a local copy, and its index."""

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from catalog.errors import RefusedError
from catalog.reasons import Reason
from catalog.safe_name import INDEX, is_safe_product_name
from tasks.objectstore.index_upload import upload_index
from tasks.objectstore.listing import records_written
from tasks.objectstore.location import ObjectStore, reaching
from tasks.objectstore.publishing import CUBE_OPENER
from tasks.publish.index import open_index
from tasks.publish.names import RESULT
from tasks.record import RECORD_FILE

if TYPE_CHECKING:
    import pandas as pd

INDEXED = (CUBE_OPENER, RESULT)  # all that a row of the index is read from


def whole_products(store: ObjectStore) -> dict[str, float]:
    """Names of the products that are whole, and when they were written (seconds since the epoch). Raises FailedError
    when the storage cannot be reached."""
    with reaching(store):
        return records_written(store)


def download_product(store: ObjectStore, product: str, into: Path) -> Path:
    """Copy a whole product into the folder `into`; returns its folder. Raises RefusedError when the store has none of
    that name, FailedError when it cannot be reached."""
    folder = into / product
    with reaching(store):
        place = store.path(product)
        if not is_safe_product_name(product) or not store.files.exists(f"{place}/{RECORD_FILE}"):
            raise RefusedError(
                Reason.PRODUCT_MISSING, f"{store.url} holds no whole product {product}.", "Check the name."
            )
        base = place.strip("/")
        names = [path.strip("/").removeprefix(f"{base}/") for path in store.files.find(place)]
        targets = [folder / name for name in names]
        if not all(target.resolve().is_relative_to(folder.resolve()) for target in targets):
            raise RefusedError(Reason.PRODUCT_UNSAFE, f"{store.url}/{product} has names that leave its folder.", "")
        for parent in {target.parent for target in targets}:
            parent.mkdir(parents=True, exist_ok=True)
        store.files.get([f"{place}/{name}" for name in names], [str(target) for target in targets])
    return folder


@contextmanager
def local_copy(store: ObjectStore, product: str) -> Iterator[Path]:
    """Folder of a copy of a product, for the `with` block."""
    with TemporaryDirectory(prefix="planetpose-") as scratch:
        yield download_product(store, product, Path(scratch))


def object_store_index(store: ObjectStore, mirror: Path) -> "pd.DataFrame":
    """The index of all whole products (see `tasks.publish.index`), read from `mirror`: a folder in which the few small
    files that a row needs are kept, brought up to date first. Raises FailedError when the store cannot be reached."""
    mirror.mkdir(parents=True, exist_ok=True)
    there = whole_products(store)
    for folder in mirror.iterdir():
        if folder.is_dir() and folder.name not in there and folder.name != INDEX:
            shutil.rmtree(folder, ignore_errors=True)
    with reaching(store):
        for product, written in there.items():
            if _mirrored_at(mirror / product) != written:
                _mirror_product(store, product, written, mirror)
    return open_index(mirror)


def publish_index(store: ObjectStore, mirror: Path) -> "pd.DataFrame":
    """The same, and the store's `index.parquet` is replaced by it."""
    table = object_store_index(store, mirror)
    upload_index(mirror, store)
    return table


def _mirrored_at(folder: Path) -> float | None:
    """When the product was written that the mirror has; None when it has none."""
    try:
        return (folder / RECORD_FILE).stat().st_mtime
    except OSError:
        return None


def _mirror_product(store: ObjectStore, product: str, written: float, mirror: Path) -> None:
    """Fetch a product's small files; an empty record, with the time of the store's, says that they are there."""
    folder = mirror / product
    shutil.rmtree(folder, ignore_errors=True)
    for name in INDEXED:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        try:
            (folder / name).write_bytes(store.files.cat_file(store.path(product, name)))
        except FileNotFoundError:
            continue  # being replaced just now: the next look finds it
        os.utime(folder / name, (written, written))
    (folder / RECORD_FILE).touch()
    os.utime(folder / RECORD_FILE, (written, written))
