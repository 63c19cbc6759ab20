"""Correct real images in this process, without Prefect; the command line then answers from the same cache."""

import json
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from catalog.errors import PlanetposeError
from flows.chain import Chain, NotCachedError, only_cached
from flows.image import correct_image
from flows.request import Request
from flows.result import result_of
from tasks.profile import Profile, find_profile
from tasks.record import Record
from tasks.step import AnyStep, run

ROOT = Path(__file__).resolve().parents[3]
PLANETPOSE = [sys.executable, "-c", "from flows.cli import main; main()"]


@dataclass(frozen=True)
class Bench:
    """folder: stores and what the tests write. data: the real mission files. cache: of steps that were done."""

    folder: Path
    data: Path
    cache: Path

    def image(self, name: str) -> Path:
        """One of the real images, such as `galileo/C0552809300R.IMG`."""
        return self.data / "images" / name

    def request(self, image: Path, store: str = "out", **options: Any) -> Request:
        """A request without kernels, unless `options` name some."""
        given = {"kernels": (), "cache": self.cache} | options
        return Request(image=image, store=self.folder / store, **given)

    def correct(self, image: Path, store: str = "out", **options: Any) -> dict[str, Any]:
        """The result that `planetpose correct --json` would print."""
        chain = Chain(self.request(image, store, **options), run_here)
        try:
            correct_image(chain)
        except PlanetposeError as error:
            return result_of(chain, error)
        return result_of(chain)

    def first_undone(self, image: Path, **options: Any) -> str | None:
        """The first step that a request would have to do."""
        try:
            correct_image(Chain(self.request(image, **options), only_cached))
        except NotCachedError as missing:
            return str(missing)
        return None

    def write(self, name: str, content: bytes | str) -> Path:
        """A file in the bench's folder."""
        path = self.folder / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    def write_json(self, name: str, content: Any) -> Path:
        """A JSON file in the bench's folder."""
        return self.write(name, json.dumps(content))

    def command(self, *arguments: str | Path) -> subprocess.CompletedProcess[str]:
        """Run planetpose in a process of its own, in the bench's folder, with the bench's cache."""
        own = {"PLANETPOSE_CACHE": str(self.cache), "PLANETPOSE_STATE": str(self.folder / "state")}
        inherited = {name: value for name, value in os.environ.items() if not name.startswith("PREFECT_")}
        return subprocess.run(
            [*PLANETPOSE, *map(str, arguments)],
            cwd=self.folder,
            env=inherited | own | {"PYTHONPATH": str(ROOT)},
            capture_output=True,
            text=True,
            timeout=240,
            check=False,
        )


def run_here(step: AnyStep) -> Record:
    """Do a step without reporting it."""
    return run(step, lambda *_: None)


def shorter(passes: int) -> Profile:
    """The standard profile with fewer passes."""
    return find_profile("standard").model_copy(update={"passes": passes})
