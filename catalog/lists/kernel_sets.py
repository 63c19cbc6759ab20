"""Named sets of kernels (`kernel_sets.toml`), and what is known of the content of archive files."""

import tomllib
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

KERNEL_SETS_FILE = Path(__file__).parent / "kernel_sets.toml"


@dataclass(frozen=True)
class KernelSet:
    """Kernels that belong together; files: locations in the order of loading."""

    name: str
    title: str
    files: tuple[str, ...]


@cache
def _content() -> dict[str, Any]:
    return tomllib.loads(KERNEL_SETS_FILE.read_text())


@cache
def known_kernel_sets() -> dict[str, KernelSet]:
    """The sets of the catalog by name."""
    tables = {name: table for name, table in _content().items() if name != "sha256"}
    return {name: KernelSet(name, table["title"], tuple(table["files"])) for name, table in tables.items()}


def expanded(kernels: Iterable[str]) -> tuple[str, ...]:
    """Locations, each once, with names of sets replaced by the set's files."""
    sets = known_kernel_sets()
    return tuple(dict.fromkeys(file for name in kernels for file in (sets[name].files if name in sets else (name,))))


def known_sha256(location: str) -> str | None:
    """The published sha256 of an archive's file, where one is known."""
    found = _content()["sha256"].get(location)
    return None if found is None else str(found)
