"""Images per second of a Dask cluster with one and with two worker processes, on the same list of simulated images."""

import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from lab.simulate.small_archive import write_small_archive

WARM_UP_PER_WORKER = 3
PROFILE_FILE = "three-steps.toml"
PROFILE = """base = "defaults"
passes = 1
steps = ["point", "range", "attitude"]
[accept]
min_likeness = 0.3
sure_likeness = 0.4
"""


def measure_throughput(count: int, workers: list[int], tell: Callable[[str], None]) -> dict[str, Any]:
    """Wall seconds and images per second with each number of workers, and the last's gain over the first.

    Every cluster first does some other images, so that its processes have started and compiled; each measured run has
    an empty cache and store. The flow is `reprocess` on the local Prefect server.
    """
    from local_server.prefect_settings import prepare, server_choice

    prepare(server_choice(None))
    with tempfile.TemporaryDirectory(prefix="planetpose-throughput-") as scratch:
        folder = Path(scratch)
        images = write_archive(folder / "images", count, seed=1)
        found = {number: _measured(number, images, count, folder, tell) for number in workers}
    first, last = found[workers[0]], found[workers[-1]]
    return {
        "images": count,
        "runs": [{"workers": number, **figures} for number, figures in found.items()],
        "gain": round(last["images_per_s"] / first["images_per_s"], 3),
    }


def write_archive(folder: Path, count: int, seed: int) -> Path:
    """Small images with a profile of some seconds of work each; path of their list."""
    images = write_small_archive(folder, count, seed)
    (folder / PROFILE_FILE).write_text(PROFILE, encoding="utf-8")
    return images


def _measured(workers: int, images: Path, count: int, folder: Path, tell: Callable[[str], None]) -> dict[str, float]:
    place = folder / f"{workers}-workers"
    warm_up = write_archive(place / "warm-up", WARM_UP_PER_WORKER * workers, seed=2)
    with dask_cluster(workers) as address:
        _reprocess(warm_up, place / "warm", address, workers)
        summary = _reprocess(images, place / "cold", address, workers)
    figures = {"wall_s": summary["wall_s"], "images_per_s": round(count / summary["wall_s"], 4)}
    tell(f"{workers} workers: {count} images in {figures['wall_s']:.1f} s, {figures['images_per_s']:.3f} per s")
    return figures


@contextmanager
def dask_cluster(workers: int) -> Iterator[str]:
    """Address of the scheduler of a cluster of so many processes of this machine, one thread each."""
    from distributed import LocalCluster

    from tasks.quiet_dask import make_dask_quiet

    make_dask_quiet()
    with LocalCluster(n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=None) as cluster:
        yield str(cluster.scheduler_address)


def _reprocess(images: Path, place: Path, address: str, workers: int) -> dict[str, Any]:
    """Summary of a cold run of the flow. Raises RuntimeError when an image is not ok."""
    from prefect.settings import PREFECT_FLOWS_HEARTBEAT_FREQUENCY, temporary_settings

    from flows.reprocess import TooManyFailedError, reprocess

    with temporary_settings({PREFECT_FLOWS_HEARTBEAT_FREQUENCY: None}):
        state = reprocess(
            images=str(images),
            store=str(place / "store"),
            profile=str(images.parent / PROFILE_FILE),
            workers=2 * workers,  # one more waits at every worker
            runner=f"dask:{address}",
            cache=str(place / "cache"),
            return_state=True,
        )
    found: Any = state.data.summary if isinstance(state.data, TooManyFailedError) else state.result()
    summary = dict(found)
    if summary["status"]["ok"] != summary["images"]:
        raise RuntimeError(f"not all images are ok: {summary['status']}, {summary['codes']}")
    return summary
