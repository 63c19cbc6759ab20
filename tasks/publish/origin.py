"""Which image a product is of, so that the image of another file never takes its place.

Two different files may have one name, as in the trees of raw and of calibrated frames of an archive. The same file may
change, or move without changing: then its product is replaced.
"""

import os
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from catalog.errors import RefusedError
from catalog.lists.location import address_in
from catalog.plain_files import own_json
from catalog.plain_text import shown_path
from catalog.reasons import Reason
from catalog.regular_file import read_regular_text
from tasks.atomic import file_put_in_place
from tasks.publish.checksums import CHECKSUMS
from tasks.publish.names import CUBE, OVERLAY, RESULT, SETTINGS
from tasks.record import RECORD_FILE, read_record, record_in, write_record

OTHER_IMAGE = Reason.PRODUCT_OF_ANOTHER_IMAGE
PARTS = (RECORD_FILE, RESULT, CUBE, CHECKSUMS, SETTINGS, OVERLAY)
MOST_PATHS = 16
DAMAGE = (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError)
REMEDY = (
    "Give one of them a name of its own (`planetpose correct --product NAME`, or the column product of an image list) "
    "or another --store; delete the product if it is to be replaced."
)


@dataclass(frozen=True)
class Origin:
    """The image of a product. sha256: of its content. paths: absolute ones, or addresses, at which it was seen, the
    latest last."""

    sha256: str
    paths: tuple[str, ...] = ()

    def is_of(self, image: Path | str, sha256: str) -> bool:
        """Whether a file is the same image: its content is, or it lies where the image was seen."""
        return sha256 == self.sha256 or any(_is_same_place(path, image) for path in self.paths)

    def seen_at(self, image: Path | str, sha256: str) -> "Origin":
        """The origin after a file of the same image was found with that content."""
        path = place_of_image(image)
        others = [known for known in self.paths if known != path]
        return Origin(sha256, (*others, path)[-MOST_PATHS:])

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON, as the record of a product has it."""
        return {"sha256": self.sha256, "paths": list(self.paths)}

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> "Origin":
        """What `to_dict` wrote. Raises KeyError or TypeError for anything else."""
        return cls(str(content["sha256"]), tuple(str(path) for path in content["paths"]))


def origin_of(folder: Path) -> Origin | None:
    """The origin of the product in `folder`; None when there is none, or it is too damaged to tell."""
    with suppress(*DAMAGE):
        return Origin.from_dict(record_in(folder).result["image"])
    with suppress(*DAMAGE):
        attributes = own_json(read_regular_text(folder / CUBE / "zarr.json"))["attributes"]
        return Origin(str(own_json(attributes["provenance"])["image"]["sha256"]))
    return None


def place_of_image(image: Path | str) -> str:
    """An address as it is, a file's absolute path."""
    return str(image) if address_in(image) and not isinstance(image, Path) else os.path.abspath(image)


def refuse_taken(folder: Path, image: Path | str, sha256: str) -> None:
    """Raises RefusedError when a product of `image` may not be put at `folder`: the product there is of another image,
    or what is there is no product and would be lost."""
    if not os.path.lexists(folder):
        return
    if not folder.is_dir() or not _is_product_or_empty(folder):
        fault = f"{folder} is there and is no product, and the product of {image} would take its place."
        raise RefusedError(Reason.PRODUCT_PLACE_TAKEN, fault, REMEDY.partition(";")[0] + ".")
    refuse_other_image(origin_of(folder), str(folder), image, sha256)


def refuse_other_image(origin: Origin | None, place: str, image: Path | str, sha256: str) -> None:
    """Raises RefusedError when a product at `place`, of that origin, is of another image than the file `image`."""
    if origin is None or origin.is_of(image, sha256):
        return
    other = origin.paths[-1] if origin.paths else f"one with the sha256 {origin.sha256}"
    fault = f"{place} is the product of another image, {other}; {place_of_image(image)} has the same name."
    raise RefusedError(OTHER_IMAGE, fault, REMEDY)


def note_place(folder: Path, image: Path | str, sha256: str) -> None:
    """Remember in the product's record that its image was seen at a new place, where that can be written."""
    with suppress(*DAMAGE):
        record = record_in(folder)
        origin = Origin.from_dict(record.result["image"])
        path = place_of_image(image)
        if path in origin.paths or sha256 != origin.sha256 or not _is_text(path):
            return
        record.result["image"] = origin.seen_at(image, sha256).to_dict()
        with file_put_in_place(folder / RECORD_FILE) as temporary:
            write_record(temporary.parent, record, temporary.name)
            if read_record(folder, record.key) is None:
                raise OSError("the product was exchanged meanwhile")


def _is_product_or_empty(folder: Path) -> bool:
    found = os.listdir(folder)
    return not found or any(os.path.lexists(folder / name) for name in PARTS)


def _is_same_place(known: str, image: Path | str) -> bool:
    place = place_of_image(image)
    return known == place or os.path.realpath(known) == os.path.realpath(place)


def _is_text(path: str) -> bool:
    return shown_path(path) == path
