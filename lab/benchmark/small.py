"""Very many small images: does any process grow, what does the orchestration cost, does the database stay usable?"""

import base64
import json
import os
import time
import urllib.request
from pathlib import Path
from typing import Any

from catalog.errors import FailedError
from catalog.reasons import Reason
from lab.faults.processes import Command, children_of, command_line, resident_mb
from lab.simulate.small_archive import PROFILE_FILE, write_small_archive
from local_server.server import ServerRecord

LOOK_EVERY_S = 2.0
WARM = 0.1  # of the images: libraries are loaded and caches filled by then
OVERHEAD_BAR_S = 0.5


def watch_small(count: int, workers: int, folder: Path) -> dict[str, Any]:
    """memory_mb: per process its resident size when a tenth of the images was done, in the middle and at the end.
    overhead_s: seconds of workers per image that went not into images: from the first image's begin to the last one's
    end, and of the whole command. database: its size, and how long it takes to answer."""
    images = write_small_archive(folder / "archive", count)
    arguments = [str(images), "--store", str(folder / "store"), "--workers", str(workers)]
    command = Command([*arguments, "--profile", str(images.parent / PROFILE_FILE)], environment(folder))
    samples: list[tuple[int, dict[str, float]]] = []
    while not command.has_ended:
        samples.append((ended_images(command), memory_of(command, folder)))
        time.sleep(LOOK_EVERY_S)
    command.await_end()
    summary = command.summary
    if summary is None:
        raise FailedError(Reason.BENCHMARK, "the command gave no summary: " + " ".join(command.noise[-3:])[:500])
    first, last = (command.stamps[event] for event in ("step", "finished"))
    during_s = last[-1] - first[0]
    return {
        "images": count,
        "workers": workers,
        "status": summary["status"],
        "command_s": command.seconds,
        "images_s": round(during_s, 2),
        "busy_s": summary["busy_s"],
        "overhead_s": round((during_s * workers - summary["busy_s"]) / count, 4),
        "overhead_with_start_s": round((command.seconds * workers - summary["busy_s"]) / count, 4),
        "bar_s": OVERHEAD_BAR_S,
        "memory_mb": grown(samples, count),
        "database": database(folder / "state" / "server"),
    }


def environment(folder: Path) -> dict[str, str]:
    """Of a command that keeps everything in `folder`."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith("PREFECT")}
    own = {"PLANETPOSE_CACHE": folder / "cache", "PLANETPOSE_STATE": folder / "state"}
    return kept | {name: str(path) for name, path in own.items()} | {"PLANETPOSE_KERNELS": ""}


def ended_images(command: Command) -> int:
    """How many images have ended."""
    return len(command.stamps.get("finished", ()))


def memory_of(command: Command, folder: Path) -> dict[str, float]:
    """Resident size of flow, workers, Prefect's server and its keeper."""
    pids = {"flow": command.pid} | {f"worker {pid}": pid for pid in command.workers()}
    for pid in server_pids(folder):
        pids["keeper" if "server_keeper" in command_line(pid) else "server"] = pid
        for child in children_of(pid):
            pids.setdefault("server's child" if "server_keeper" not in command_line(pid) else "server", child)
    sizes = {name: resident_mb(pid) for name, pid in pids.items()}
    return {name: size for name, size in sizes.items() if size is not None}


def server_pids(folder: Path) -> list[int]:
    """Keeper and server of the Prefect in `folder`."""
    try:
        record = json.loads((folder / "state" / "server" / "server.json").read_text())
    except (OSError, ValueError):
        return []
    return [record["keeper_pid"], record["server_pid"]]


def grown(samples: list[tuple[int, dict[str, float]]], count: int) -> dict[str, dict[str, float | int]]:
    """Per process: MB at a tenth of the images, half-way, with the last image, and the largest of all, the run's end
    included, when index and tables are written; samples: how many."""
    found: dict[str, dict[str, float | int]] = {}
    warm = [(ended, sizes) for ended, sizes in samples if ended >= WARM * count]
    for name in {name for ended, sizes in warm for name in sizes if ended < count}:
        series = [sizes[name] for ended, sizes in warm if name in sizes and ended < count]
        middle = series[len(series) // 2]
        found[name] = {
            "first": series[0],
            "middle": middle,
            "last": series[-1],
            "largest": max(sizes.get(name, 0.0) for _, sizes in warm),
            "samples": len(series),
        }
    return dict(sorted(found.items()))


def database(server: Path) -> dict[str, float | int]:
    """Size of Prefect's database (with its log), runs of tasks in it, and seconds that two usual questions take."""
    files = list((server / "prefect").glob("prefect.db*"))
    size_mb = round(sum(path.stat().st_size for path in files) / 1e6, 1)
    try:
        record = ServerRecord(**json.loads((server / "server.json").read_text()))
        count, count_s = ask(record, "task_runs/count", {})
        _, page_s = ask(record, "task_runs/filter", {"limit": 200, "sort": "EXPECTED_START_TIME_DESC"})
        _, flows_s = ask(record, "flow_runs/filter", {"limit": 50})
    except (OSError, ValueError) as error:
        raise FailedError(Reason.DATABASE, f"Prefect's database does not answer: {error}.") from error
    return {"mb": size_mb, "task_runs": count, "count_s": count_s, "page_of_200_s": page_s, "flow_runs_s": flows_s}


def ask(record: ServerRecord, path: str, body: dict[str, Any]) -> tuple[Any, float]:
    """The API's answer and its seconds."""
    password = base64.b64encode(record.credentials.encode()).decode()
    headers = {"Content-Type": "application/json", "Authorization": f"Basic {password}"}
    request = urllib.request.Request(f"{record.url}/{path}", json.dumps(body).encode(), headers)
    started = time.monotonic()
    with urllib.request.urlopen(request, timeout=60) as reply:
        answer = json.loads(reply.read())
    return answer, round(time.monotonic() - started, 3)
