"""Cameras that are made rather than looked up: `kernels:NAME`, `isd:FILE` and `isis:CUBE`."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from catalog.errors import RefusedError
from catalog.isd import content_from_isd
from catalog.isis_tables import content_from_cube, cube_label, is_isis_cube
from catalog.kernel_camera import content_from_kernels
from catalog.packed import readable
from catalog.reasons import Reason
from catalog.settings import default_kernels

KERNELS, ISD, ISIS = "kernels:", "isd:", "isis:"
PREFIXES = (KERNELS, ISD, ISIS)
MADE_REMEDY = "Give kernels:NAME (a NAIF instrument name or id, with --kernels), isd:FILE.json or isis:FILE.cub."


def is_made(name: str | None) -> bool:
    """Whether a camera's name says that it is to be made from kernels or from a file."""
    return name is not None and name.lower().startswith(PREFIXES)


def camera_carried_by(path: Path) -> tuple[str | None, str | None]:
    """Name (`isis:FILE`) of the camera that an ISIS cube carries in its NaifKeywords, and else why it makes none; both
    None for other files, and for cubes without keywords (before spiceinit)."""
    try:
        with readable(path) as cube:
            if not is_isis_cube(cube):
                return None, None
            label = cube_label(cube)
            if "NaifKeywords" not in label:
                return None, None
            content_from_cube(cube, label)
    except RefusedError as error:
        return None, f"its NaifKeywords make none ({error.fault.rstrip('.')})"
    return f"{ISIS}{path}", None


def file_in(name: str) -> Path | None:
    """The file that an `isd:` or `isis:` camera is made from; None for kernels."""
    return None if name.lower().startswith(KERNELS) else Path(name.partition(":")[2])


def made_content(
    name: str,
    kernels: Iterable[Path] | None = None,
    filter_name: str | None = None,
    temperature_c: float | None = None,
) -> dict[str, Any]:
    """Content of a camera file for `kernels:NAME|ID`, `isd:FILE` or `isis:FILE`. kernels: None takes the default ones.

    Raises RefusedError when kernels or file do not make one.
    """
    rest = name.partition(":")[2].strip()
    if not rest:
        raise RefusedError(Reason.CAMERA_UNKNOWN, f"camera {name!r} names nothing to make it from.", MADE_REMEDY)
    if name.lower().startswith(KERNELS):
        used = default_kernels() if kernels is None else list(kernels)
        return content_from_kernels(used, rest, None, filter_name, temperature_c)
    if name.lower().startswith(ISD):
        return content_from_isd(Path(rest))
    with readable(Path(rest)) as cube:
        return content_from_cube(cube)
