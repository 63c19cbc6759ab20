"""What an archive costs on machines that share nothing but S3, and whether anything is lost when they are."""

import json
import math
import random
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import psutil

from lab.rehearsal.processes import RehearsalError, Session
from lab.scale.cluster import Cluster, reprocess
from lab.scale.s3 import BUCKET, S3Server
from lab.simulate.small_archive import LIST, PROFILE_FILE, write_small_archive

LEASE_S = "20"
AWAY_S = 30.0
TROUBLES = ("worker", "worker", "scheduler", "command", "s3")
PAUSE_S = (0.0, 6.0)  # from the publication of a product to the next trouble
WARM_UP, FEW = 2, 4
RUN_TIMEOUT_S, STUCK_S = 3600.0, 300.0
STORE, CACHE = f"s3://{BUCKET}/store", f"s3://{BUCKET}/cache"


@dataclass
class Site:
    """S3 with the images in it, a cluster, and where the command runs."""

    folder: Path
    s3: S3Server
    files: Any
    cluster: Cluster
    images: int

    def start(self, more: tuple[str, ...] = ()) -> Session:
        """The command on the list. more: its other options."""
        arguments = [
            f"s3://{BUCKET}/list/{LIST}", "--store", STORE, "--cache", CACHE,
            "--runner", f"dask:{self.cluster.address}",
            "--profile", str(self.folder / "images" / PROFILE_FILE), "--workers", str(2 * len(self.cluster.workers)),
            "--retries", "4", "--retry-delay-s", "2", *more,
        ]  # fmt: skip
        return reprocess(self.folder / "command", self.s3.environment | {"PLANETPOSE_LEASE_S": LEASE_S}, arguments)

    def products(self) -> int:
        """Whole products in the store."""
        return len(self.files.glob(f"{BUCKET}/store/*/record.json"))


@contextmanager
def site(images: int, workers: int) -> Iterator[Site]:
    """Everything up, and the images in S3; all ends with the block."""
    with tempfile.TemporaryDirectory(prefix="planetpose-scale-") as scratch, ExitStack() as ends:
        folder = Path(scratch)
        (folder / "command").mkdir()
        archive = write_small_archive(folder / "images", images).parent
        s3 = S3Server(folder)
        ends.callback(s3.end)
        files = s3.start()
        for path in sorted(archive.iterdir()):
            files.put_file(str(path), f"{BUCKET}/list/{path.name}")
        cluster = Cluster(folder, s3.environment | {"PLANETPOSE_LEASE_S": LEASE_S}, workers)
        ends.callback(cluster.end)
        ends.callback(stop_server, folder / "command")
        yield Site(folder, s3, files, cluster, images)


def measure_costs(images: int, tell: Callable[[str], None]) -> dict[str, Any]:
    """Requests, bytes and processor seconds per image: of one more image that is new, and of one that is unchanged.

    The first images start the worker's processes and Prefect's server and are left out. A run of the command costs
    something by itself: what one more image costs is the difference of two runs by the difference of their images.
    """
    small, large = FEW, WARM_UP + FEW + images
    with site(large, 1) as on:
        tell(f"first {WARM_UP} images: {measured(on, ('--only', f'small-0000[0-{WARM_UP - 1}]'))}")
        few = measured(on, ("--only", f"small-0000[0-{WARM_UP + small - 1}]"))
        new = measured(on)
        measured(on)  # reads what was remembered of the new ones
        few_again, unchanged = measured(on, ("--only", f"small-0000[0-{WARM_UP + small - 1}]")), measured(on)
        return {
            "images": large,
            "new": per_image(new, few, images - small),
            "unchanged": per_image(unchanged, few_again, large - WARM_UP - small),
            **state_of(on),
        }


def measured(on: Site, more: tuple[str, ...] = ()) -> dict[str, float]:
    """One run of the command: its requests to S3, bytes between it and S3, processor seconds of the
    worker, and of the images among them."""
    on.s3.requests()
    before = (on.s3.relay.bytes, on.cluster.processor_s())
    command = on.start(more)
    if command.process.wait(RUN_TIMEOUT_S):
        raise RehearsalError(command.log.read_text()[-3000:])
    after = (on.s3.relay.bytes, on.cluster.processor_s())
    found: dict[str, float] = {name: b - a for name, a, b in zip(("bytes", "worker_s"), before, after, strict=True)}
    kinds = on.s3.requests()
    summary = json.loads(command.log.read_text().splitlines()[-1])
    found["objects"] = kinds.places["PUT store"]
    return {**found, "image_s": summary["cpu_s"], **{f"{name} requests": n for name, n in kinds.to_dict().items()}}


def servers_of(place: Path) -> list[int]:
    """Processes of the Prefect server that the command started."""
    found = []
    for process in psutil.process_iter():
        with suppress(psutil.Error):
            if process.environ().get("PLANETPOSE_STATE") == str(place / "state") and "server" in process.cmdline():
                found.append(process.pid)
    return found


def stop_server(place: Path) -> None:
    """End the Prefect server that the command started."""
    for pid in servers_of(place):
        with suppress(psutil.Error):
            psutil.Process(pid).kill()


def per_image(more: dict[str, float], fewer: dict[str, float], images: int) -> dict[str, float]:
    """What a run that had to do with so many images more did more, by image."""
    return {name: round((value - fewer.get(name, 0.0)) / images, 3) for name, value in more.items()}


def state_of(on: Site) -> dict[str, Any]:
    """How many products of the list are in the store, whole and sound, and how many are not."""
    from tasks.objectstore.checked import each_checked

    faults = {place.rpartition("/")[2]: found for place, found in each_checked([STORE])}
    return {
        "whole": sum(not found for found in faults.values()),
        "unsound": sum(bool(found) for found in faults.values()),
        "lost": on.images - len(faults),
    }


def disturb(images: int, troubles: int, seed: int, tell: Callable[[str], None]) -> dict[str, Any]:
    """A list done while workers, the scheduler, the command and S3 are lost, one after another at random moments, and
    run again where the command ended; then what is in the store, and how often each product was published."""
    draw, counts, published, begun = random.Random(seed), Counter[str](), Counter[str](), 0
    seen = 0
    with site(images, 2) as on:
        command, since, next_s = on.start(), time.monotonic(), math.inf
        while True:
            time.sleep(0.5)
            on.cluster.tend()
            published += noted(on, tell)
            if command.process.poll() is not None or time.monotonic() - since > STUCK_S:
                command.lose()
                if len(published) >= images and command.process.returncode == 0:
                    break
                command, since, begun = on.start(), time.monotonic(), begun + 1
                tell(f"the command begins again, {len(published)} of {images} published")
            if len(published) > seen and next_s == math.inf:
                next_s = time.monotonic() + draw.uniform(*PAUSE_S)
            if sum(counts.values()) < troubles and time.monotonic() > next_s:
                trouble = TROUBLES[sum(counts.values()) % len(TROUBLES)]
                tell(f"{time.strftime('%H:%M:%S')} {len(published)} published: {trouble} is lost")
                cause(on, trouble, command, draw)
                counts[trouble] += 1
                seen, next_s = len(published), math.inf
        published += noted(on, tell)
        found = {"images": images, "troubles": dict(counts), "begun_again": begun, **state_of(on)}
    return found | {"published_twice": sum(n > 1 for n in published.values())}


def noted(on: Site, tell: Callable[[str], None]) -> Counter[str]:
    """How often the record of each product was written since the last look."""
    found = on.s3.requests()
    for write in found.writes:
        tell(write)
    return found.records


def cause(on: Site, trouble: str, command: Session, draw: random.Random) -> None:
    """Lose something."""
    if trouble == "worker":
        on.cluster.lose_worker(draw.randrange(len(on.cluster.workers)))
    elif trouble == "scheduler":
        on.cluster.lose_scheduler()
    elif trouble == "command":
        command.lose()
    else:
        with on.s3.relay.cut():
            time.sleep(AWAY_S)
