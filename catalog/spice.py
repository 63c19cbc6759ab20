"""SPICE kernels: a pool that is furnished for one piece of work and emptied again, whatever happens inside.

SPICE's kernel pool and its error state are global to the process and not thread-safe: everything here holds one lock.
"""

import tempfile
import threading
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from itertools import islice, zip_longest
from pathlib import Path
from typing import Any

from catalog.digest import sha256_of_file
from catalog.errors import RefusedError
from catalog.kernel_text import MAX_PATH, id_word, is_binary, members_of, read_text_kernel
from catalog.reasons import Reason
from catalog.regular_file import check_regular, is_folder

KIND_OF_SUFFIX = {
    ".tls": "lsk", ".tpc": "pck", ".bpc": "pck", ".tf": "fk", ".ti": "ik", ".tsc": "sclk", ".bsp": "spk", ".bc": "ck",
}  # fmt: skip
BINARY_SUFFIXES = (".bsp", ".bc", ".bpc")
KIND_ORDER = ("lsk", "pck", "fk", "ik", "sclk", "spk", "ck", "other", "meta")
MAX_META_DEPTH = 10
MAX_KERNELS = 5300  # that SPICE keeps loaded (MAXFIL of its KEEPER)

_POOL_LOCK = threading.RLock()


@dataclass(frozen=True)
class Kernel:
    """One kernel file: its kind (lsk, pck, fk, ik, sclk, spk, ck, meta, other) and where it is. furnished: what SPICE
    was given in its place (a short link, or a copy that it reads whole); None for the file itself."""

    path: Path
    kind: str
    furnished: Path | None = None

    @property
    def sha256(self) -> str:
        """Hex digest of the file's content. Raises RefusedError when it cannot be read."""
        try:
            return sha256_of_file(self.path)
        except OSError as error:
            raise _unreadable(self.path, error) from error

    @property
    def for_spice(self) -> str:
        """The path that SPICE knows it by."""
        return str(self.furnished or self.path)

    def provenance(self) -> dict[str, str]:
        """Name and content hash, for the product."""
        return {"name": self.path.name, "sha256": self.sha256}


def kernel_kind(path: Path) -> str:
    """Kind of a kernel by its content; by its suffix where that says nothing, and for a file that is not there; `other`
    when neither does."""
    by_suffix = "meta" if path.suffix.lower() == ".tm" else KIND_OF_SUFFIX.get(path.suffix.lower(), "other")
    if not path.is_file():
        return by_suffix
    word = id_word(path)
    if is_binary(path):
        return word if word in KIND_ORDER else by_suffix
    if path.suffix.lower() in BINARY_SUFFIXES:
        return by_suffix  # refused when it is furnished
    if read_text_kernel(path).is_meta:
        return "meta"
    return word if word in KIND_ORDER else by_suffix.replace("meta", "other")


def list_kernels(paths: Iterable[Path]) -> list[Kernel]:
    """Kernels to furnish, in order: by type (lsk, pck, fk, ik, sclk, spk, ck), within a type as given, folders searched
    recursively by sorted name for known suffixes, meta-kernels last, each followed by what it names. SPICE prefers what
    comes later.

    Raises RefusedError naming a path that does not exist or is no file, and a text kernel that holds nothing.
    """
    files: list[Path] = []
    for path in map(Path, paths):
        if is_folder(path):
            files += sorted(p for p in path.rglob("*") if p.suffix.lower() in KIND_OF_SUFFIX and p.is_file())
        else:
            files.append(path)
    kernels = sorted(map(_of_file, files), key=lambda k: KIND_ORDER.index(k.kind))
    found = list(islice((each for kernel in kernels for each in _with_members(kernel, ())), MAX_KERNELS + 1))
    if len(found) > MAX_KERNELS:
        fault = f"kernels from {kernels[0].path} to {kernels[-1].path}: with what meta-kernels name there are more than"
        remedy = "Name each kernel once, and only those of the images' times."
        raise RefusedError(Reason.KERNEL_TOO_MANY, f"{fault} the {MAX_KERNELS} that SPICE can load.", remedy)
    return found


class KernelLists:
    """Kernels as they are offered: a set is looked through once in the life of this, for all images of a list share a
    few sets."""

    def __init__(self) -> None:
        self._listed: dict[tuple[Path, ...], list[Kernel]] = {}

    def of(self, paths: list[Path]) -> list[Kernel]:
        """As `list_kernels`."""
        key = tuple(paths)
        if key not in self._listed:
            self._listed[key] = list_kernels(paths)
        return self._listed[key]


def kernel_inputs(kernels: list[Kernel]) -> tuple[tuple[str, str], ...]:
    """Name and content hash of kernels."""
    return tuple((kernel.path.name, kernel.sha256) for kernel in kernels)


def _with_members(kernel: Kernel, above: tuple[Path, ...]) -> Iterator[Kernel]:
    """A kernel, and what it names if it is a meta-kernel, in its own order; meta-kernels may name others."""
    yield kernel
    if kernel.kind != "meta":
        return
    path = kernel.path.resolve()
    if path in above or len(above) >= MAX_META_DEPTH:
        fault = f"meta-kernel {kernel.path} names itself, over {', '.join(other.name for other in above)}."
        raise RefusedError(Reason.KERNEL_UNREADABLE, fault, "Name each kernel once.")
    members = members_of(kernel.path, read_text_kernel(kernel.path))
    kernels = {member: _of_file(member) for member in dict.fromkeys(members)}
    for member in members:
        yield from _with_members(kernels[member], (*above, path))


def _of_file(path: Path) -> Kernel:
    try:
        check_regular(path)
        return Kernel(path, kernel_kind(path))
    except FileNotFoundError as error:
        remedy = "Give a kernel file or a folder."
        raise RefusedError(Reason.KERNEL_MISSING, f"kernel {path} does not exist.", remedy) from error
    except OSError as error:
        raise _unreadable(path, error) from error


def _unreadable(path: Path, error: OSError) -> RefusedError:
    fault = f"kernel {path} cannot be read: {error.strerror}."
    return RefusedError(Reason.KERNEL_UNREADABLE, fault, "Give a file of the SPICE formats that may be read.")


def refuse_what_holds_no_kernel(paths: Iterable[Path]) -> None:
    """Raises RefusedError naming a folder without kernels, or a file that SPICE would read as an empty text kernel: an
    image whose label has the geometry would be corrected without them in silence."""
    for path in map(Path, paths):
        if not list_kernels([path]):
            fault = f"the folder {path} holds no kernel ({', '.join((*KIND_OF_SUFFIX, '.tm'))})."
            raise RefusedError(Reason.KERNEL_MISSING, fault, "Give a folder that does, or kernel files.")


@contextmanager
def kernel_pool(paths: Iterable[Path]) -> Iterator[list[Kernel]]:
    """Furnish kernels (files, folders, meta-kernels) for the `with` block, under the process-wide lock.

    Yields what is loaded, and the meta-kernels that named some of it: what `list_kernels` says beforehand, of which
    keys of steps are made, and SPICE itself afterwards. At exit, also after an error, only what was furnished here is
    unloaded. Raises RefusedError naming a kernel that SPICE cannot load, or where it has loaded another one.
    """
    import spiceypy

    wanted = list_kernels(paths)
    with _POOL_LOCK, ExitStack() as until_unloaded:
        was_empty, before = _pool_is_empty(), spiceypy.ktotal("ALL")
        loaded: list[Kernel] = []
        furnished: list[str] = []
        try:
            for kernel in wanted:
                ready = _readable(kernel, until_unloaded)
                loaded.append(ready)
                if ready.kind != "meta" or ready.furnished:
                    furnished.append(ready.for_spice)  # first: what fails half-way must be unloaded too
                    _furnish(ready)
            _refuse_what_spice_holds_otherwise(loaded, furnished, before)
            yield loaded
        finally:
            if was_empty:
                spiceypy.kclear()  # unloading one text kernel makes SPICE read all others again: 1 s instead of 1 ms
            else:
                for path in reversed(furnished):
                    spiceypy.unload(path)


def _refuse_what_spice_holds_otherwise(ready: list[Kernel], furnished: list[str], before: int) -> None:
    """Raises RefusedError where what SPICE says it has loaded beside the first `before` kernels is not what was
    `furnished`, in its order."""
    import spiceypy

    held = [spiceypy.kdata(number, "ALL")[0] for number in range(before, spiceypy.ktotal("ALL"))]
    if held == furnished:
        return
    paths = {kernel.for_spice: kernel.path for kernel in ready}
    given, found = next(pair for pair in zip_longest(furnished, held) if pair[0] != pair[1])
    fault = f"SPICE has loaded {found or 'nothing'} in place of kernel {paths.get(given or '', 'none')}."
    raise RefusedError("kernel-unreadable", fault, "Give each kernel by --kernels, without a meta-kernel.")


def _readable(kernel: Kernel, until_unloaded: ExitStack) -> Kernel:
    """The kernel in a form that SPICE reads whole: under a path of at most 255 characters, its text with what SPICE
    would pass over, a meta-kernel without the kernels that it names, which are furnished one by one."""
    if kernel.path.suffix.lower() in BINARY_SUFFIXES and not is_binary(kernel.path):
        raise RefusedError(  # SPICE would take it for an empty text kernel
            Reason.KERNEL_UNREADABLE,
            f"kernel {kernel.path} is no binary SPICE file.",
            "Fetch it again; it may be cut short.",
        )
    statements = None
    if not is_binary(kernel.path):
        text = read_text_kernel(kernel.path)
        statements = text.own if kernel.kind == "meta" else () if text.as_spice_reads else text.statements
    if not statements and (kernel.kind == "meta" or len(str(kernel.path)) <= MAX_PATH):
        return kernel
    folder = Path(until_unloaded.enter_context(tempfile.TemporaryDirectory(prefix="kernel-")))
    place = folder / f"kernel{kernel.path.suffix[:20]}"
    if statements:
        lines = [line for statement in statements for line in statement.lines()]
        place.write_text(
            "\n".join(["KPL/MK" if kernel.kind == "meta" else "", "\\begindata", *lines, ""]), encoding="latin-1"
        )
    else:
        place.symlink_to(kernel.path.absolute())
    return Kernel(kernel.path, kernel.kind, place)


def _pool_is_empty() -> bool:
    import spiceypy

    try:
        return spiceypy.ktotal("ALL") == 0 and not spiceypy.gnpool("*", 0, 1)
    except spiceypy.NotFoundError:
        return True


def _furnish(kernel: Kernel) -> None:
    import spiceypy

    try:
        spiceypy.furnsh(kernel.for_spice)
    except spiceypy.utils.exceptions.SpiceyError as error:
        raise RefusedError(
            Reason.KERNEL_UNREADABLE,
            f"SPICE cannot load kernel {kernel.path}: {spice_message(error)}.",
            "Give kernels of the SPICE formats; the paths inside a meta-kernel must exist.",
        ) from error


def spice_message(error: Any) -> str:
    """The one useful line of a SPICE error."""
    text = str(getattr(error, "long", "") or getattr(error, "short", "") or error)
    return " ".join(text.split())[:300].rstrip(".")
