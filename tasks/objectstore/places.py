"""Where products go: a folder, or an object store with a local store before it; and the index of each."""

import hashlib
import logging
import os
import re
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from catalog.errors import RefusedError
from catalog.regular_file import is_folder
from catalog.settings import cache_folder, state_folder
from tasks.boundary import PUBLISHED
from tasks.objectstore.location import is_url, open_object_store
from tasks.publish.index_parts import PART_ROWS

if TYPE_CHECKING:
    import pandas as pd

logger = logging.getLogger("planetpose")
# Products that an index may lack while a batch publishes more, as a share of those in it, or in one part of it. Choice:
# all updates together then write eleven times as many rows as there are products, however many there are.
SHARE = 0.1


@dataclass(frozen=True)
class Place:
    """store: folder that products are made in. publish_to: URL of the object store that they are then copied to."""

    store: Path
    publish_to: str | None = None


def place_of(store: str | Path) -> Place:
    """The place that `--store` names. For a URL products are first made in a local store of the user's state folder
    (PLANETPOSE_STATE), which has to last: it is what later runs compare with."""
    text = str(store)
    if not is_url(text):
        return Place(Path(store))
    return Place(local_store_of(text), text.rstrip("/"))


def usable_place_of(store: str | Path) -> Place:
    """`place_of`, after a look whether products can be written there, for that would only be found out after all
    steps. Raises RefusedError when the folder is a file, or may not be written in."""
    place = place_of(store)
    remedy = "Give a folder; it is made if need be."
    try:
        place.store.stat()
    except (FileNotFoundError, NotADirectoryError):
        pass  # to be made, or below a file
    except (OSError, ValueError) as error:  # its name is too long, a link to itself, behind a locked folder
        fault = error.strerror if isinstance(error, OSError) else error
        raise RefusedError("store-unusable", f"store {store}: {fault}.", remedy) from error
    existing = next(path for path in (place.store, *place.store.absolute().parents) if os.path.lexists(path))
    if not is_folder(existing):
        what = "a link to what is not there" if existing.is_symlink() and not existing.exists() else "a file"
        fault = f"{existing} is {what}" if existing == place.store else f"{existing} on its way is {what}"
        raise RefusedError("store-unusable", f"store {store}: {fault}.", remedy)
    if not os.access(existing, os.W_OK | os.X_OK):
        fault = f"store {store}: nothing may be written in the folder {existing}."
        raise RefusedError("store-unusable", fault, "Change its permissions, or give another --store.")
    return place


def local_store_of(url: str) -> Path:
    """The local store before the object store at `url`."""
    named = re.sub(r"[^A-Za-z0-9._-]+", "-", url.rstrip("/")).strip("-")[:80]
    return state_folder() / "stores" / f"{named}-{hashlib.sha256(url.rstrip('/').encode()).hexdigest()[:8]}"


def index_mirror_of(url: str) -> Path:
    """Folder that keeps what the index of the object store at `url` is made of."""
    return cache_folder() / "indices" / local_store_of(url).name


def index_object_store(url: str) -> "pd.DataFrame":
    """Bring `index.parquet` of the object store at `url` up to date and return it. Raises RefusedError or FailedError
    when the store is unknown or cannot be reached."""
    from tasks.objectstore.reading import publish_index

    return publish_index(open_object_store(url), index_mirror_of(url))


def note_in_index(store: Path, result: dict[str, Any]) -> None:
    """Bring the index of `store` up to date when `result` is of an image that was published just now."""
    if is_new(result):
        index_store(store, [result["product"]] if "product" in result else None)


class Indexing:
    """Keeps the indices of the stores that a batch publishes to: each is brought up to date when the products that it
    lacks are more than SHARE of those in it, or in one part of it, and when the `with` block ends. Doing so after each
    product would write a part as often as there are products."""

    def __init__(self) -> None:
        self._lacking: dict[Path, list[str | None]] = {}
        self._rows: dict[Path, int] = {}

    def note(self, store: Path, result: dict[str, Any]) -> None:
        """Bring the index of `store` up to date if that is due now that `result` is there."""
        if is_new(result):
            lacking = self._lacking.setdefault(store, [])
            lacking.append(result.get("product"))
            if len(lacking) > SHARE * min(self._rows.get(store, 0), PART_ROWS):
                self._update(store)

    def _update(self, store: Path) -> None:
        named = [product for product in self._lacking[store] if product is not None]
        all_named = len(named) == len(self._lacking[store])
        self._rows[store] = index_store(store, named) if all_named else index_store(store)
        del self._lacking[store]

    def __enter__(self) -> "Indexing":
        return self

    def __exit__(self, *_: object) -> None:
        for store in list(self._lacking):
            self._update(store)


def is_new(result: dict[str, Any]) -> bool:
    """Whether the image of `result` was published just now."""
    return result["status"] in PUBLISHED and "publish" not in result["cached"]


def index_store(store: Path, products: Collection[str] | None = None) -> int:
    """Bring the index of `store` up to date; how many rows it has then. products: those that may have changed, where
    that is known; the others are not looked at."""
    from tasks.publish.index import index_all, update_index

    try:
        return index_all(store) if products is None else update_index(store, products)
    except OSError as error:  # the products are there all the same, and the next reader brings it up to date
        logger.warning("the index of %s was not written: %s", store, error)
        return 0
