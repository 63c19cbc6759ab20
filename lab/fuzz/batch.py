"""One batch of good images and one that spoils it, by the way of the command but without Prefect; what is amiss."""

import json
import re
import shutil
import time
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from catalog.plain_text import shown_path
from flows.guided import REQUESTS
from flows.one_image import one_result
from flows.progress import Silent
from flows.request import Request
from flows.run import InOrder, run_requests
from lab.fuzz.spoils import SPOILS, Spoilt
from lab.simulate.small_archive import CAMERA_FILE, POSE_FILE, PROFILE_FILE, write_small_archive
from tasks.boundary import PUBLISHED
from tasks.publish.checksums import checksum_faults
from tasks.publish.index import open_index
from tasks.record import Record
from tasks.step import AnyStep, run
from tasks.work import Progress

GOOD = 2
FRESH_EVERY = 3  # in every third batch the good images are published anew, in the others they are there
LONGEST_S = 10.0
REASON = re.compile(r"[a-z]+(-[a-z]+)+: .+\. \S.*", re.DOTALL)  # code, fault, and after it a remedy
Result = dict[str, Any]


@dataclass(frozen=True)
class Ground:
    """Where batches are: an archive of good images, whose steps up to publication are in the cache."""

    folder: Path

    @property
    def archive(self) -> Path:
        """The good images, their camera, pose and profile."""
        return self.folder / "archive"

    @property
    def first(self) -> Path:
        """A store with the good images' products."""
        return self.folder / "first"

    def request(self, image: Path, store: Path, **options: Any) -> Request:
        """The request for one image."""
        usual: dict[str, Any] = {
            "camera": str(self.archive / CAMERA_FILE),
            "target": "europa",
            "pose_file": self.archive / POSE_FILE,
            "profile": str(self.archive / PROFILE_FILE),
            "kernels": (),
            "cache": self.folder / "cache",
        }
        return Request(image=image, store=store, **{**usual, **options})

    def prepare(self) -> None:
        """Make the images and correct them once. Raises RuntimeError when that does not go well."""
        write_small_archive(self.archive, GOOD)
        for image in self.images():
            result = one_result(self.request(image, self.first), Silent(), run_step=run)
            if result["status"] not in PUBLISHED:
                raise RuntimeError(f"a good image is {result['status']}: {result['reason']}")

    def images(self) -> list[Path]:
        """The good ones."""
        return sorted(self.archive.glob("small-*.png"))


def spoil_of(number: int) -> str:
    """Which spoil a batch gets: they take turns."""
    return list(SPOILS)[number % len(SPOILS)]


def run_batch(ground: Ground, number: int, seed: int) -> dict[str, Any]:
    """Run a batch; plain JSON: spoil, status and reason of the image that spoils it, its seconds, all that is amiss."""
    random = np.random.default_rng([seed, number])
    folder = ground.folder / f"batch-{number}"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    good, store = ground.images(), folder / "store"
    if number % FRESH_EVERY:
        shutil.copytree(ground.first, store)
    spoilt = SPOILS[spoil_of(number)](folder, good[0].read_bytes(), random)
    requests = [ground.request(image, store) for image in good]
    place = int(random.integers(GOOD + 1))
    requests.insert(place, ground.request(spoilt.image, store, **spoilt.options))
    took: dict[int, float] = {}
    results = corrected(requests, place, spoilt, took)
    bad = results[place] if len(results) == len(requests) else {}
    faults = list(faults_of(requests, results, place, spoilt))
    if took.get(place, 0.0) > LONGEST_S:
        faults.append(f"it took {took[place]:.1f} s")
    shutil.rmtree(folder, ignore_errors=True)
    reported = {"spoil": spoil_of(number), "status": bad.get("status"), "reason": bad.get("reason")}
    return {**reported, "seconds": round(took.get(place, 0.0), 3), "faults": faults}


def corrected(requests: list[Request], place: int, spoilt: Spoilt, took: dict[int, float]) -> list[Result]:
    """Results of the requests as the command `correct` tells them; `took` gets the seconds of each that needs work."""
    reported: list[Result] = []

    def run_step(position: int, step: AnyStep, progress: Progress) -> Record:
        if position == place:
            spoilt.meanwhile(step.kind.name)
        return run(step, progress)

    def without_prefect(rest: list[Request], ordered: InOrder, positions: list[int]) -> None:
        for request, position in zip(rest, positions, strict=True):
            started = time.monotonic()
            ordered.put(position, one_result(request, Silent(), run_step=partial(run_step, position)))
            took[position] = time.monotonic() - started

    run_requests(requests, "none", 1, Silent(), reported.append, without_prefect)
    return reported


def faults_of(requests: list[Request], results: list[Result], place: int, spoilt: Spoilt) -> Iterator[str]:
    """All that is amiss, in words."""
    if [result["product"] for result in results] != [request.product for request in requests]:
        yield f"{len(results)} results for {len(requests)} images: {[result['product'] for result in results]}"
        return
    store, published = requests[0].store, set()
    for position, (request, result) in enumerate(zip(requests, results, strict=True)):
        yield from faults_of_text(result)
        if result["status"] in PUBLISHED:
            published.add(request.product)
            yield from (f"{request.product}: {fault}" for fault in checksum_faults(request.product_folder))
        elif position != place:
            yield f"a good image is {result['status']}: {result['reason']}"
        elif spoilt.sound:
            yield f"a sound image is {result['status']}: {result['reason']}"
        else:
            yield from faults_of_reason(result, spoilt)
    there = {path.name for path in store.iterdir()} if store.is_dir() else set()
    known = published | {"index.parquet", ".index.lock", REQUESTS}
    if there - known or published - there:
        yield f"the store holds {sorted(there)} for {sorted(published)}"
    if published != set(open_index(store)["product"]):
        yield f"the index has {sorted(open_index(store)['product'])} for {sorted(published)}"


def faults_of_text(result: Result) -> Iterator[str]:
    """A result has to be JSON that every reader takes, on one line."""
    try:
        json.dumps(result, ensure_ascii=False, allow_nan=False).encode()
    except ValueError as error:
        yield f"a result is no JSON: {error}"
    if "\n" in str(result["reason"]):
        yield "a reason has several lines"


def faults_of_reason(result: Result, spoilt: Spoilt) -> Iterator[str]:
    """A reason names the file at fault and says what to do; it is no bug."""
    reason = str(result["reason"])
    if not REASON.fullmatch(reason):
        yield f"no reason with a remedy: {reason}"
    if shown_path(spoilt.culprit.name) not in reason:
        yield f"the reason does not name {shown_path(spoilt.culprit.name)}: {reason}"
