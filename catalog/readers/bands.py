"""Which of several planes of a file is meant."""

from collections.abc import Sequence
from pathlib import Path

from catalog.errors import RefusedError
from catalog.reasons import Reason

MAX_LISTED = 12


def chosen_plane(path: Path, names: Sequence[str], plane: str | None, default: int | None = None) -> int:
    """Number (from 0) of the plane that the user means: by its number, from 1, or its name, in any case.

    names: of the file's planes, in order; "" where one has none. default: the plane to take where the user says
    nothing. Raises RefusedError, listing the planes, where it is not said and not plain, or there is no such plane.
    """
    wanted = (plane or "").strip()
    if not wanted:
        if len(names) == 1 or default is not None:
            return default or 0
        fault = f"image {path}: it has {len(names)} planes: {listed(names)}"
        raise RefusedError(
            Reason.SEVERAL_PLANES, f"{fault}.", "Say which one is meant: --plane NUMBER (from 1) or --plane NAME."
        )
    found = [place for place, name in enumerate(names) if name and name.strip().lower() == wanted.lower()]
    if len(found) == 1:
        return found[0]
    if wanted.isdecimal() and 1 <= int(wanted) <= len(names):
        return int(wanted) - 1
    fault = (
        f"image {path}: there is no plane {wanted!r}" if not found else f"image {path}: {wanted!r} names {len(found)}"
    )
    raise RefusedError(
        Reason.IMAGE_PLANE_UNKNOWN, f"{fault}, its planes are {listed(names)}.", "Give --plane NUMBER (from 1)."
    )


def listed(names: Sequence[str]) -> str:
    """The planes for a person: numbers from 1, and names."""
    shown = [f"{place + 1}" + (f" ({name})" if name else "") for place, name in enumerate(names[:MAX_LISTED])]
    return ", ".join(shown) + (f" ... {len(names)}" if len(names) > MAX_LISTED else "")
