"""Requests of the command `stars`."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from catalog.errors import RefusedError, WrongOptionError
from catalog.image_mode import ImageMode
from catalog.settings import default_kernels
from catalog.stars.files import FileCatalog
from catalog.target import find_target
from tasks.stars.image import StarRequest, catalog_of, near_direction


def requests_of(options: Mapping[str, Any], kernels: Sequence[Path] | None) -> Iterator[StarRequest]:
    """A request per file. options: as `flows.options.StarsOptions` has them. Raises WrongOptionError for columns that
    are not NAME=COLUMN, and as `catalog_of` and `near_direction`; RefusedError for a file that is no star catalog."""
    catalog = catalog_of(options["catalog"], columns_of(options["columns"]), options["epoch"])
    if isinstance(catalog, FileCatalog):
        catalog.check()
    check_near(options["near"])
    used = default_kernels() if kernels is None else kernels
    mode = ImageMode(options["summing"], None, "--summing") if options["summing"] else None
    same = ("near", "cone_deg", "camera", "pose_file", "mask", "flip", "plane")
    shared = {name: options[name] for name in same}
    return (
        StarRequest(image=file, catalog=catalog, kernels=tuple(used), mode=mode, **shared) for file in options["files"]
    )


def check_near(near: str | None) -> None:
    """Raise WrongOptionError where `near` is neither a target nor a direction."""
    if near is None or near_direction(near) is not None:
        return
    try:
        find_target(near)
    except RefusedError as error:
        remedy = "Give a name of `planetpose targets`, or RA,DEC in degrees."
        raise WrongOptionError("near", f"{near!r} is no target of the catalog.", remedy) from error


def columns_of(given: Sequence[str]) -> dict[str, str]:
    """Our names of columns with the file's, of texts NAME=COLUMN. Raises WrongOptionError."""
    pairs = [text.partition("=") for text in given]
    if wrong := [text for text, (name, _, column) in zip(given, pairs, strict=True) if not name or not column]:
        raise WrongOptionError("columns", f"{wrong[0]!r} is not NAME=COLUMN.", "For example ra_deg=RA,magnitude=Gmag.")
    return {name.strip(): column.strip() for name, _, column in pairs}
