"""What an image list is: rows that say where an image is, what it shows, and what belongs to it."""

import re
from pathlib import Path, PurePosixPath
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from catalog.flips import Flip
from catalog.image_mode import Window
from catalog.lists.kernel_sets import expanded
from catalog.lists.location import Location, address_beside, parse_location
from catalog.lists.part import parse_part, part_of
from catalog.safe_name import safe_product_name

NO_FILES = ("none", "image")  # in place of a base map, of a pose file
SHA256 = r"^[0-9a-f]{64}$"


class ImageEntry(BaseModel):
    """One image of a list.

    product: name of its folder in a store; the image file's without suffix by default. image, label: a path (relative
    to the list's folder), a URL, or `ARCHIVE:path` with an archive of `archives.toml`. camera, target: names, or TOML
    files; None leaves it to the label. kernels: locations, or names of `kernel_sets.toml`; empty means the
    user's own. pose_file, truth_file: pose files, as paths; a pose file "image" stands for a pose found in the image.
    basemap: a location, or "none"; None takes the catalog's. flip: how the picture is mirrored or turned. plane,
    summing, window: as the options of `planetpose correct`. utc: middle of the exposure. sha256, label_sha256, bytes:
    of the files themselves. truth: what a simulation planted, by name. notes: for people.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", str_strip_whitespace=True)

    product: str = Field(min_length=1)
    image: str = Field(min_length=1)
    label: str | None = None
    camera: str | None = None
    target: str | None = None
    utc: str | None = None
    exposure_s: float | None = Field(default=None, ge=0, allow_inf_nan=False)
    filter: str | None = None
    kernels: tuple[str, ...] = ()
    pose_file: str | None = None
    basemap: str | None = None
    map_left_edge_deg: float = Field(default=0.0, ge=-360, le=360)
    flip: Flip | None = None
    plane: str | None = None
    summing: int | None = Field(default=None, ge=1)
    window: Window | None = None
    truth_file: str | None = None
    sha256: str | None = Field(default=None, pattern=SHA256)
    label_sha256: str | None = Field(default=None, pattern=SHA256)
    bytes: int | None = Field(default=None, gt=0)
    truth: dict[str, float | int | str | bool | None] = Field(default_factory=dict)
    notes: str = ""

    @model_validator(mode="before")
    @classmethod
    def _named_by_its_file(cls, content: Any) -> Any:
        if not isinstance(content, dict):
            return content
        file = re.split(r"[/\\:]", str(content.get("image", "")).strip())[-1]
        return {"product": safe_product_name(PurePosixPath(file).stem), **content}

    @field_validator("product")
    @classmethod
    def _is_a_folder_name(cls, name: str) -> str:
        safe = safe_product_name(name)
        if safe != name:
            raise ValueError(f"{name!r} is no name for a folder in a store; {safe!r} would be")
        return name

    @field_validator("image", "label", "pose_file", "truth_file", "basemap")
    @classmethod
    def _is_a_location(cls, text: str | None) -> str | None:
        if text is not None:
            parse_location(text)
        return text

    @field_validator("kernels")
    @classmethod
    def _are_locations(cls, texts: tuple[str, ...]) -> tuple[str, ...]:
        for text in texts:
            parse_location(text)
        return texts

    @field_validator("image", "label", "camera", "target", "filter", "utc", "notes")
    @classmethod
    def _is_printable(cls, text: str | None) -> str | None:
        if text is not None and not text.isprintable():
            raise ValueError(f"{text!r} holds control characters")
        return text

    @field_validator("camera", "target")
    @classmethod
    def _is_in_the_catalog(cls, name: str | None, info: Any) -> str | None:
        from catalog.camera import known_cameras
        from catalog.made_camera import is_made

        if not name or info.field_name != "camera" or name.endswith(".toml") or is_made(name):
            return name
        if name.lower() not in known_cameras():
            raise ValueError(f"camera {name!r} is unknown; known: {', '.join(known_cameras())}, or a FILE.toml")
        return name


class ImageList(BaseModel):
    """A catalog of images. file: where it was read from; paths of its entries are relative to that file's folder.
    missing: what could not be found or verified, in words."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str
    title: str = ""
    entries: tuple[ImageEntry, ...] = ()
    sources: tuple[str, ...] = ()
    missing: tuple[str, ...] = ()
    file: Path | None = None

    @property
    def folder(self) -> Path:
        """Folder that relative paths start from."""
        return self.file.parent if self.file else Path()

    def located(self, text: str, archive: Path | None = None) -> Path:
        """Where a location of this list is on this machine: a path as it is, what has to be fetched below `archive`
        (default: the user's, `catalog.settings.archive_folder`). The file need not exist."""
        location: Location = parse_location(text)
        return location.local_path(self.folder, archive)

    def kernel_paths(self, entry: ImageEntry, archive: Path | None = None) -> tuple[Path, ...]:
        """Where the kernels of an entry are on this machine, sets expanded; () means the user's own."""
        return tuple(self.located(text, archive) for text in expanded(entry.kernels))

    def beside(self, address: str) -> "ImageList":
        """The list as it was read at an address: what its entries name by relative paths is beside it there."""
        names = ("image", "label", "pose_file", "truth_file", "basemap")

        def there(text: str) -> str:
            is_path = parse_location(text).url is None and not text.startswith(("/", "~"))
            return address_beside(address, text) if is_path else text

        def entry_there(entry: ImageEntry) -> ImageEntry:
            changed = {name: there(text) for name in names if (text := getattr(entry, name)) not in (None, *NO_FILES)}
            files = {
                name: there(text)
                for name in ("camera", "target")
                if (text := getattr(entry, name) or "").endswith(".toml")
            }
            return entry.model_copy(update=changed | files)

        return self.model_copy(update={"entries": tuple(entry_there(entry) for entry in self.entries)})

    def only(self, products: tuple[str, ...]) -> "ImageList":
        """The list with those entries alone whose product matches one of the shell patterns (`C16*`)."""
        from fnmatch import fnmatchcase

        chosen = tuple(e for e in self.entries if any(fnmatchcase(e.product, pattern) for pattern in products))
        return self.model_copy(update={"entries": chosen})

    def part(self, text: str) -> "ImageList":
        """The list with the entries of a part alone, see `catalog.lists.part`. Raises ValueError as `parse_part`."""
        number, count = parse_part(text)
        chosen = tuple(entry for entry in self.entries if part_of(entry.product, count) == number)
        return self.model_copy(update={"entries": chosen})
