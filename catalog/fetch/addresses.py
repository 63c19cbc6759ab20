"""Files of an image that are at addresses: where they come to on this machine, and having them there."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict

from catalog.absent import Absent
from catalog.errors import RefusedError
from catalog.fetch.remote import RemoteImage, have_image, have_shared, version_now
from catalog.lists.location import address_in, parse_location
from catalog.reasons import Reason

M = TypeVar("M", bound=BaseModel)
FILES = ("image", "pose_file", "basemap", "shape", "mask")
NAMES = ("camera", "target")  # a name, or a file


class Addresses(BaseModel):
    """archive: folder of fetched files. files: address of each file by its path below it. sha256: of the image's
    content, where a list says it."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    archive: Path
    files: dict[str, str] = {}
    sha256: str | None = None

    def of(self, path: Path | str | None) -> str | None:
        """The address of a file of this machine; None of one that has none."""
        if path is None or not Path(path).is_relative_to(self.archive):
            return None
        return self.files.get(Path(path).relative_to(self.archive).as_posix())

    def moved(self, path: Path, archive: Path) -> Path:
        """Where a file is on a machine with another folder of fetched files."""
        return archive / path.relative_to(self.archive) if self.of(path) else path

    def have(self, image: Path) -> RemoteImage | None:
        """Have all files there; what is known of the image, None where that is no fetched one. Raises FailedError."""
        self.have_others(image)
        address = self.of(image)
        return have_image(address, self.archive, self.sha256) if address else None

    def have_others(self, image: Path) -> None:
        """Have the files that are not the image. Raises FailedError."""
        for other in self.files.values():
            if other != self.of(image):
                have_shared(other, self.archive)

    def unchanged(self, image: Path, source: Mapping[str, Any]) -> tuple[Absent, ...] | None:
        """What stands in for an image, and for its label, that are now what they were when `source` (a `RemoteImage`)
        was had; None when they are not. The other files are had. Raises FailedError when nobody says."""
        known = RemoteImage.model_validate(source)
        self.have_others(image)
        if version_now(str(self.of(image)), known) != known.version:
            return None
        label = image.parent / known.label if known.label else None
        other = (Absent(label, str(known.label_sha256), image),) if label else ()
        return (Absent(image, known.sha256, label), *other)


def with_addresses(request: M, archive: Path) -> M:
    """The request of an image with places below `archive` for the addresses among its files, which are fetched when
    they are needed. Raises RefusedError for an address that names no file."""
    places: dict[str, Path] = {}
    files: dict[str, str] = {}
    for text in _texts_of(request):
        if address := address_in(text):
            try:
                path = parse_location(address).path
            except ValueError as error:
                remedy = "Use https://host/path or s3://bucket/key."
                raise RefusedError(Reason.ADDRESS_INVALID, f"{error}.", remedy) from error
            places[text], files[path] = archive / path, address
    if not files:
        return request
    return _replaced(request, places, Addresses(archive=archive, files=files))


def with_files_in(request: M, archive: Path) -> M:
    """The request of another machine, whose folder of fetched files was another one."""
    known: Addresses | None = getattr(request, "addresses", None)
    if known is None:
        return request
    moved = {text: known.moved(Path(text), archive) for text in _texts_of(request) if known.of(text)}
    return _replaced(request, moved, known.model_copy(update={"archive": archive}))


def _texts_of(request: BaseModel) -> list[str]:
    """The options of a request that are files, or may be."""
    single = [str(value) for name in (*FILES, *NAMES) if (value := getattr(request, name))]
    return single + [str(path) for path in getattr(request, "kernels", None) or ()]


def _replaced(request: M, places: Mapping[str, Path], addresses: Addresses) -> M:
    changed: dict[str, Any] = {"addresses": addresses}
    for name in (*FILES, *NAMES):
        place = places.get(str(getattr(request, name)))
        if place is not None:
            changed[name] = str(place) if name in NAMES else place
    kernels = getattr(request, "kernels", None)
    if kernels:
        changed["kernels"] = tuple(places.get(str(path), path) for path in kernels)
    return request.model_copy(update=changed)
