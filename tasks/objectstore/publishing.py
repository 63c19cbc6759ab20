"""Copy a whole product into an object store so that nobody takes half of it for a product.

An object store exchanges single objects, not folders. While a product is being replaced it has no `record.json`, which
is the mark of a whole product, and its cube no `zarr.json`, without which no reader opens it; both come last. A writer
that dies leaves a product without them, and the next one starts anew. One process at a time writes a product: it holds
the product's lease.
"""

from dataclasses import dataclass
from pathlib import Path

from catalog.errors import FailedError
from catalog.plain_files import own_json
from catalog.reasons import Reason
from tasks.objectstore.conditional import read_object
from tasks.objectstore.lease import check_lease, leased
from tasks.objectstore.listing import sizes_below
from tasks.objectstore.location import ObjectStore, open_object_store, reaching
from tasks.publish.checksums import CHECKSUMS
from tasks.publish.contained import refuse_what_is_elsewhere
from tasks.publish.names import CUBE
from tasks.publish.origin import Origin, origin_of
from tasks.record import RECORD_FILE

CUBE_OPENER = f"{CUBE}/zarr.json"
LAST = (CUBE_OPENER, CHECKSUMS, RECORD_FILE)  # in this order; deleted in the opposite one


@dataclass(frozen=True)
class Copied:
    """How much a publication copied, and how many objects of an older product it deleted."""

    files: int
    bytes: int
    deleted: int


def published_key(store: ObjectStore, product: str) -> str | None:
    """Key of the whole product in the store; None when there is none, or none that is whole. Raises FailedError when
    the storage cannot be reached."""
    text = _record_of(store, product)
    try:
        return str(own_json(text)["key"]) if text else None
    except (ValueError, KeyError, TypeError):
        return None


def published_origin(store: ObjectStore, product: str) -> Origin | None:
    """Which image the whole product in the store is of; None when there is none, or nobody knows. Raises FailedError
    when the storage cannot be reached."""
    text = _record_of(store, product)
    try:
        return Origin.from_dict(own_json(text)["result"]["image"]) if text else None
    except (ValueError, KeyError, TypeError):
        return None


def origin_at(url: str | None, folder: Path) -> Origin | None:
    """The same of the product that `folder` is the local one of; None for `url`: there is no other."""
    return origin_of(folder) if url is None else published_origin(open_object_store(url), folder.name)


def product_fault_at(url: str, product: str, key: str | None) -> str | None:
    """What is wrong with the product in the object store that was published under a key. Raises FailedError."""
    whole = published_key(open_object_store(url), product) == key
    return None if whole else "product is not in the object store"


def _record_of(store: ObjectStore, product: str) -> bytes | None:
    with reaching(store):
        return read_object(store, f"{product}/{RECORD_FILE}")


def publish_product(folder: Path, store: ObjectStore) -> Copied:
    """Copy the product in `folder`, replacing an older one of its name. Raises FailedError when the storage cannot be
    reached, or has not what was written."""
    refuse_what_is_elsewhere(folder)
    with leased(store, folder.name):
        return _publish(folder, store)


def _publish(folder: Path, store: ObjectStore) -> Copied:
    place = store.path(folder.name)
    sizes = {path.relative_to(folder).as_posix(): path.stat().st_size for path in folder.rglob("*") if path.is_file()}
    with reaching(store):
        older = set(sizes_below(store, folder.name))
        check_lease(store, folder.name)
        _delete(store, place, [name for name in reversed(LAST) if name in older])
        body = sorted(name for name in sizes if name not in LAST)
        store.files.put([str(folder / name) for name in body], [f"{place}/{name}" for name in body])
        _delete(store, place, sorted(older - set(sizes) - set(LAST)))
        for name in LAST:
            if name in sizes:
                check_lease(store, folder.name)
                store.files.put_file(str(folder / name), f"{place}/{name}")
        written = sizes_below(store, folder.name)
    if written != sizes:
        differing = sorted(name for name in written.keys() | sizes.keys() if written.get(name) != sizes.get(name))
        fault = f"store {store.url} has not what was written: {folder.name}/{differing[0]}."
        raise FailedError(
            Reason.STORE_DIFFERS, fault, "Is another program writing there? Try again."
        ) from ConnectionError(differing[0])
    return Copied(len(sizes), sum(sizes.values()), len(older - set(sizes)))


def _delete(store: ObjectStore, place: str, names: list[str]) -> None:
    for name in names:
        try:
            store.files.rm_file(f"{place}/{name}")
        except FileNotFoundError:  # another writer of the same product was quicker
            continue
