"""SPICE kernels: a pool that is furnished for one piece of work and emptied again, whatever happens inside.

SPICE's kernel pool and its error state are global to the process and not thread-safe: everything here holds one lock.
"""

import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from catalog.digest import sha256_of_file
from catalog.errors import RefusedError
from catalog.regular_file import MAX_TEXT_BYTES, check_regular, open_regular

KIND_OF_SUFFIX = {
    ".tls": "lsk", ".tpc": "pck", ".bpc": "pck", ".tf": "fk", ".ti": "ik", ".tsc": "sclk", ".bsp": "spk", ".bc": "ck",
}  # fmt: skip
BINARY_SUFFIXES = (".bsp", ".bc", ".bpc")
KIND_ORDER = ("lsk", "pck", "fk", "ik", "sclk", "spk", "ck", "other", "meta")

_POOL_LOCK = threading.RLock()


@dataclass(frozen=True)
class Kernel:
    """One kernel file: its kind (lsk, pck, fk, ik, sclk, spk, ck, meta, other) and where it is."""

    path: Path
    kind: str

    @property
    def sha256(self) -> str:
        """Hex digest of the file's content. Raises RefusedError when it cannot be read."""
        try:
            return sha256_of_file(self.path)
        except OSError as error:
            raise _unreadable(self.path, error) from error

    def provenance(self) -> dict[str, str]:
        """Name and content hash, for the product."""
        return {"name": self.path.name, "sha256": self.sha256}


def kernel_kind(path: Path) -> str:
    """Kind of a kernel by its suffix; `other` when the suffix says nothing (SPICE looks inside)."""
    return "meta" if path.suffix.lower() == ".tm" else KIND_OF_SUFFIX.get(path.suffix.lower(), "other")


def list_kernels(paths: Iterable[Path]) -> list[Kernel]:
    """Kernels to furnish, in order: by type (lsk, pck, fk, ik, sclk, spk, ck), within a type as given, folders searched
    recursively by sorted name for known suffixes, meta-kernels last. SPICE prefers what comes later.

    Raises RefusedError naming a path that does not exist, or is no file.
    """
    kernels: list[Kernel] = []
    for path in map(Path, paths):
        if path.is_dir():
            found = sorted(p for p in path.rglob("*") if p.suffix.lower() in KIND_OF_SUFFIX and p.is_file())
            kernels += [Kernel(p, kernel_kind(p)) for p in found]
        else:
            kernels.append(_of_file(path))
    return sorted(kernels, key=lambda kernel: KIND_ORDER.index(kernel.kind))


def _of_file(path: Path) -> Kernel:
    try:
        check_regular(path)
    except FileNotFoundError as error:
        remedy = "Give a kernel file or a folder."
        raise RefusedError("kernel-missing", f"kernel {path} does not exist.", remedy) from error
    except OSError as error:
        raise _unreadable(path, error) from error
    return Kernel(path, kernel_kind(path))


def _unreadable(path: Path, error: OSError) -> RefusedError:
    fault = f"kernel {path} cannot be read: {error.strerror}."
    return RefusedError("kernel-unreadable", fault, "Give a file of the SPICE formats that may be read.")


def refuse_what_holds_no_kernel(paths: Iterable[Path]) -> None:
    """Raises RefusedError naming a folder without kernels, or a file that SPICE would read as an empty text kernel: an
    image whose label has the geometry would be corrected without them in silence."""
    for path in map(Path, paths):
        if path.is_dir() and not list_kernels([path]):
            fault = f"the folder {path} holds no kernel ({', '.join((*KIND_OF_SUFFIX, '.tm'))})."
            raise RefusedError("kernel-missing", fault, "Give a folder that does, or kernel files.")
        if not path.is_dir() and kernel_kind(_of_file(path).path) == "other" and not _looks_like_a_kernel(path):
            fault = f"kernel {path} is neither a binary SPICE file nor a text with \\begindata."
            raise RefusedError("kernel-unreadable", fault, "Give kernels of the SPICE formats.")


def _looks_like_a_kernel(path: Path) -> bool:
    head = _head(path, len(b"NAIF/"))
    return head.startswith((b"DAF/", b"DAS/", b"NAIF/")) or b"\\begindata" in _head(path, MAX_TEXT_BYTES)


@contextmanager
def kernel_pool(paths: Iterable[Path]) -> Iterator[list[Kernel]]:
    """Furnish kernels (files, folders, meta-kernels) for the `with` block, under the process-wide lock.

    Yields what is loaded, a meta-kernel's members included. At exit, also after an error, only what was furnished here
    is unloaded. Raises RefusedError naming a kernel that SPICE cannot load.
    """
    import spiceypy

    wanted = list_kernels(paths)
    with _POOL_LOCK:
        was_empty = _pool_is_empty()
        loaded: list[Kernel] = []
        try:
            for kernel in wanted:
                loaded.append(kernel)  # first: a meta-kernel that fails half-way must be unloaded too
                _furnish(kernel)
            yield loaded + _members_of_meta_kernels(loaded)
        finally:
            if was_empty:
                spiceypy.kclear()  # unloading one text kernel makes SPICE read all others again: 1 s instead of 1 ms
            else:
                for kernel in reversed(loaded):
                    spiceypy.unload(str(kernel.path))


def _pool_is_empty() -> bool:
    import spiceypy

    try:
        return spiceypy.ktotal("ALL") == 0 and not spiceypy.gnpool("*", 0, 1)
    except spiceypy.NotFoundError:
        return True


def _head(path: Path, count: int) -> bytes:
    with open_regular(path) as file:
        return file.read(count)


def _furnish(kernel: Kernel) -> None:
    import spiceypy

    if kernel.path.suffix.lower() in BINARY_SUFFIXES and _head(kernel.path, 3) not in (b"DAF", b"NAI"):
        raise RefusedError(  # SPICE would take it for an empty text kernel
            "kernel-unreadable",
            f"kernel {kernel.path} is no binary SPICE file.",
            "Fetch it again; it may be cut short.",
        )
    try:
        spiceypy.furnsh(str(kernel.path))
    except spiceypy.utils.exceptions.SpiceyError as error:
        raise RefusedError(
            "kernel-unreadable",
            f"SPICE cannot load kernel {kernel.path}: {spice_message(error)}.",
            "Give kernels of the SPICE formats; the paths inside a meta-kernel must exist.",
        ) from error


def _members_of_meta_kernels(loaded: list[Kernel]) -> list[Kernel]:
    import spiceypy

    sources = {str(kernel.path) for kernel in loaded if kernel.kind == "meta"}
    if not sources:
        return []
    entries = [spiceypy.kdata(i, "ALL") for i in range(spiceypy.ktotal("ALL"))]
    return [Kernel(Path(name), kernel_kind(Path(name))) for name, _, source, _ in entries if source in sources]


def spice_message(error: Any) -> str:
    """The one useful line of a SPICE error."""
    text = str(getattr(error, "long", "") or getattr(error, "short", "") or error)
    return " ".join(text.split())[:300].rstrip(".")
