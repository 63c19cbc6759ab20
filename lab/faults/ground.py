"""The ground that faults are tried on: a small archive, what its products must be, and a look at what a store has."""

import os
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

from flows.options import BOOKS
from flows.reprocessing.worker import CLAIMS
from lab.faults.processes import Command
from lab.simulate.small_archive import LIST, PROFILE_FILE, write_small_archive
from tasks.atomic import TEMPORARY_SUFFIX
from tasks.outcomes import all_outcomes
from tasks.publish.checksums import read_checksums

ARRAYS = "/c/"  # chunks of arrays in a cube: the same for the same pose, unlike times and seconds


@dataclass(frozen=True)
class Place:
    """A store and a cache of its own."""

    folder: Path

    @property
    def store(self) -> Path:
        """The store."""
        return self.folder / "store"

    @property
    def cache(self) -> Path:
        """The cache of steps."""
        return self.folder / "cache"


@dataclass
class Ground:
    """folder: all of it. images: how many. chunks: per product the digests of its cube's arrays, as an undisturbed run
    made them. steps: how many steps that run did."""

    folder: Path
    images: int
    chunks: dict[str, dict[str, str]] = field(default_factory=dict)
    steps: int = 0

    def prepare(self) -> None:
        """Write the archive and do the undisturbed run. Raises RuntimeError when that is not ok."""
        write_small_archive(self.archive, self.images)
        place = self.place("undisturbed")
        command = self.start(place)
        status = command.await_end()
        summary = command.summary
        if status != 0 or summary is None:
            raise RuntimeError("the undisturbed run was not ok: " + "; ".join(command.noise[-5:]))
        self.steps = sum(summary["steps_done"].values())
        self.chunks = {product.name: chunks_of(product) for product in products_in(place.store)}

    @property
    def archive(self) -> Path:
        """The folder of the images."""
        return self.folder / "archive"

    def place(self, name: str) -> Place:
        """A place of that name."""
        folder = self.folder / name
        folder.mkdir(parents=True, exist_ok=True)
        return Place(folder)

    def environment(self, place: Place, state: str = "state") -> dict[str, str]:
        """Of a command that works in a place; with an own Prefect server."""
        kept = {name: value for name, value in os.environ.items() if not name.startswith("PREFECT")}
        return kept | {
            "PLANETPOSE_CACHE": str(place.cache),
            "PLANETPOSE_STATE": str(self.folder / state),
            "PLANETPOSE_KERNELS": "",
            "PLANETPOSE_SERVER_IDLE_MINUTES": "3",
        }

    def start(self, place: Place, *options: str, limit_bytes: int | None = None, state: str = "state") -> Command:
        """The command, started."""
        usual = ("--workers", "2", "--retry-delay-s", "0.2", "--profile", str(self.archive / PROFILE_FILE))
        arguments = [str(self.archive / LIST), "--store", str(place.store), *usual, *options]
        return Command(arguments, self.environment(place, state), limit_bytes)


@dataclass(frozen=True)
class Look:
    """What a place has. ok, wrong, lost: images by what became of them; left: temporaries and claims."""

    ok: int
    wrong: tuple[str, ...]
    lost: tuple[str, ...]
    left: tuple[str, ...]

    @property
    def is_good(self) -> bool:
        """Whether every cube is there and right, and nothing is left over."""
        return not (self.wrong or self.lost or self.left)


def look_at(place: Place, ground: Ground) -> Look:
    """Compare a place with what it must have."""
    there = {product.name: chunks_of(product) for product in products_in(place.store)}
    ok = {outcome.product for outcome in all_outcomes(place.store / BOOKS) if outcome.status == "ok"}
    right = {name for name, chunks in ground.chunks.items() if there.get(name) == chunks}
    return Look(
        ok=len(ok & right),
        wrong=tuple(sorted(there.keys() - right)),
        lost=tuple(sorted(ground.chunks.keys() - there.keys() | (right - ok))),
        left=tuple(sorted(left_over(place))),
    )


def products_in(store: Path) -> list[Path]:
    """Folders of products."""
    return sorted(path for path in store.glob("[!.]*") if path.is_dir())


def chunks_of(product: Path) -> dict[str, str]:
    """Digests of a cube's arrays, computed now."""
    from catalog.digest import sha256_of_file

    try:
        names = [name for name in read_checksums(product) if ARRAYS in name]
        return {name: sha256_of_file(product / name) for name in names}
    except (OSError, ValueError):
        return {}


def left_over(place: Place) -> Iterable[str]:
    """Temporaries and claims."""
    for folder in (place.store, place.cache):
        for path in folder.rglob(f".*{TEMPORARY_SUFFIX}"):
            yield str(path.relative_to(place.folder))
    for path in (place.store / BOOKS / CLAIMS).glob("*"):
        yield str(path.relative_to(place.folder))
