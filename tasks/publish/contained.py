"""What lies in a product's folder is the product's: nothing that a link leads to outside of the store is read.

A store may come from somewhere else, and a link in it could lead to any file of this machine; its content would end in
a report or an export. Links that stay within the store, as git-annex makes them, are followed.
"""

import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from catalog.errors import RefusedError
from catalog.plain_text import printable
from catalog.reasons import Reason

DAMAGE = (OSError, ValueError, LookupError, TypeError, AttributeError, ArithmeticError, RuntimeError, MemoryError)


def refuse_what_is_elsewhere(folder: Path) -> None:
    """Raises RefusedError naming the first of `faults_of_place` in a product's folder."""
    _refuse(faults_of_place(folder))


@contextmanager
def reading_product(folder: Path) -> Iterator[None]:
    """What the `with` block reads is of the product in `folder`: RefusedError as `refuse_what_is_elsewhere`, and in
    place of whatever damage makes libraries raise."""
    refuse_what_is_elsewhere(folder)
    with _damage_refused(folder):
        yield


@contextmanager
def reading_cube(cube: Path) -> Iterator[None]:
    """The same for a cube alone, or another part of a product that is a folder."""
    _refuse(_faults_below(cube, _store_of(cube.parent)))
    with _damage_refused(cube.parent):
        yield


@contextmanager
def _damage_refused(folder: Path) -> Iterator[None]:
    try:
        yield
    except DAMAGE as error:
        raise damage_refused(folder, error) from error


def damage_refused(folder: Path, error: BaseException) -> RefusedError:
    """What to raise in place of the `error` of a library that reads the damaged product in `folder`."""
    return RefusedError(
        Reason.CUBE_UNREADABLE,
        f"the cube in {folder} cannot be read ({type(error).__name__}: {error}).",
        "`planetpose check` says what is wrong with it; publish it again.",
    )


def _refuse(faults: Iterator[str]) -> None:
    fault = next(faults, None)
    if fault is not None:
        remedy = "Put the files themselves there; a product of another place is used by giving its own folder."
        raise RefusedError(Reason.PRODUCT_ELSEWHERE, f"{fault}.", remedy)


def faults_of_place(folder: Path) -> Iterator[str]:
    """In words: each link of a product's folder, or the folder itself, that leads out of the store, and what is neither
    file nor folder, for a pipe would be waited for; also a name that cannot be written into a table."""
    if not folder.name.isprintable():
        yield f"the name of the folder {printable(str(folder))} is no printable text"
        return
    yield from _faults_below(folder, _store_of(folder))


def _store_of(product: Path) -> str:
    return os.path.realpath(os.path.dirname(os.path.abspath(product)))


def _faults_below(top: Path, store: str) -> Iterator[str]:
    seen: set[str] = set()
    waiting = [str(top)]
    while waiting:
        place = waiting.pop()
        fault = _fault_of(place, store, place == str(top))
        if fault:
            yield fault
        elif os.path.isdir(place) and (target := os.path.realpath(place)) not in seen:
            seen.add(target)
            waiting += [os.path.join(place, name) for name in sorted(os.listdir(place), reverse=True)]


def _fault_of(path: str, store: str, is_top: bool) -> str | None:
    """None also for a link to nothing: what is missing is reported by who reads it."""
    try:
        mode = os.lstat(path).st_mode
        if is_top or stat.S_ISLNK(mode):
            target = os.path.realpath(path)
            if os.path.commonpath([store, target]) != store:
                return f"{path} is a link to {target}, outside of the store"
            mode = os.stat(path).st_mode
    except OSError:
        return None
    return None if stat.S_ISDIR(mode) or stat.S_ISREG(mode) else f"{path} is neither a file nor a folder"
