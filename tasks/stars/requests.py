"""Requests of the command `stars`."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from catalog.errors import WrongOptionError
from catalog.image_mode import ImageMode
from catalog.settings import default_kernels
from tasks.stars.image import StarRequest, catalog_of, near_direction


def requests_of(options: Mapping[str, Any], kernels: Sequence[Path] | None) -> Iterator[StarRequest]:
    """A request per file. options: as `flows.options.StarsOptions` has them. Raises WrongOptionError for columns that
    are not NAME=COLUMN, and as `catalog_of` and `near_direction`."""
    catalog = catalog_of(options["catalog"], columns_of(options["columns"]), options["epoch"])
    near_direction(options["near"])
    used = default_kernels() if kernels is None else kernels
    mode = ImageMode(options["summing"], None, "--summing") if options["summing"] else None
    same = ("near", "cone_deg", "camera", "pose_file", "mask", "flip", "plane")
    shared = {name: options[name] for name in same}
    return (
        StarRequest(image=file, catalog=catalog, kernels=tuple(used), mode=mode, **shared) for file in options["files"]
    )


def columns_of(given: Sequence[str]) -> dict[str, str]:
    """Our names of columns with the file's, of texts NAME=COLUMN. Raises WrongOptionError."""
    pairs = [text.partition("=") for text in given]
    if wrong := [text for text, (name, _, column) in zip(given, pairs, strict=True) if not name or not column]:
        raise WrongOptionError("columns", f"{wrong[0]!r} is not NAME=COLUMN.", "For example ra_deg=RA,magnitude=Gmag.")
    return {name.strip(): column.strip() for name, _, column in pairs}
