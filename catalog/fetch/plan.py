"""Which files an image list needs, each once, and where each comes from."""

from collections.abc import Iterator
from pathlib import Path

from catalog.basemap import NO_MAP
from catalog.errors import RefusedError
from catalog.fetch.item import Item
from catalog.lists.kernel_sets import expanded, known_sha256
from catalog.lists.location import Location, parse_location
from catalog.lists.model import ImageEntry, ImageList
from catalog.reasons import Reason

KINDS = ("images", "labels", "kernels", "maps")


def planned_items(image_list: ImageList, mirror: str | None = None, kinds: tuple[str, ...] = KINDS) -> list[Item]:
    """The files to fetch for a list, in its order; local paths need none.

    mirror: URL or folder that stands for all archives: the file is at MIRROR/ARCHIVE/path (URLs of no archive:
    MIRROR/HOST/path).
    """
    items: dict[str, Item] = {}
    for entry in image_list.entries:
        for text, sha256, size in _needed(entry, kinds):
            location = parse_location(text)
            if location.url is None:
                continue
            old = items.get(location.path)
            products = (*old.products, entry.product) if old else (entry.product,)
            source = _source(location, mirror)
            items[location.path] = Item(text, source, location.path, sha256 or known_sha256(text), size, products)
    return list(items.values())


def item_of(text: str, mirror: str | None = None) -> Item:
    """The item of one location. Raises RefusedError for a path, which needs no fetching."""
    location = parse_location(text)
    if location.url is None:
        raise RefusedError(
            Reason.LOCATION_LOCAL, f"{text} is a path, not a place in an archive.", "Use the file as it is."
        )
    return Item(text, _source(location, mirror), location.path, known_sha256(text))


def _needed(entry: ImageEntry, kinds: tuple[str, ...]) -> Iterator[tuple[str, str | None, int | None]]:
    if "images" in kinds:
        yield entry.image, entry.sha256, entry.bytes
    if "labels" in kinds and entry.label:
        yield entry.label, entry.label_sha256, None
    if "kernels" in kinds:
        yield from ((text, None, None) for text in expanded(entry.kernels))
    if "maps" in kinds and entry.basemap not in (None, NO_MAP):
        yield entry.basemap, None, None


def _source(location: Location, mirror: str | None) -> str:
    if mirror is None or mirror.lower().startswith(("http:", "https:", "s3:")):
        return str(location.url_at(mirror))
    return str(Path(mirror).expanduser().absolute() / location.path)
