"""What goes wrong: each scenario disturbs a run at a place; afterwards the same command is run once more."""

import json
import os
import random
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from lab.faults.ground import Ground, Place
from lab.faults.processes import PATIENCE_S, Command, kill, runs, wait_for

Disturb = Callable[[Ground, Place, random.Random], str]
SMALLEST_DISK_KB = 300
LITTLE_S = 0.3
LIMIT_BYTES = 9_000  # no array of an image fits, its records do


def worker_killed(ground: Ground, place: Place, chance: random.Random) -> str:
    """kill -9 of a process that does images; the run goes on."""
    command, moment = at_random_moment(ground, place, chance)
    workers = command.workers()
    if workers:
        kill(chance.choice(workers))
    return f"{moment}; {ended(command)}"


def command_killed(ground: Ground, place: Place, chance: random.Random) -> str:
    """kill -9 of the flow's process; those that do images must end by themselves."""
    command, moment = at_random_moment(ground, place, chance)
    workers = command.workers()
    command.kill()
    gone = wait_for(lambda: not any(runs(pid) for pid in workers), 60.0)
    return f"{moment}; workers {'ended too' if gone else 'STILL RUN'}"


def all_killed(ground: Ground, place: Place, chance: random.Random) -> str:
    """kill -9 of flow, workers, and Prefect's server with its keeper: as if the machine went down."""
    command, moment = at_random_moment(ground, place, chance)
    for pid in [command.pid, *command.workers(), *server_pids(ground)]:
        kill(pid)
    command.await_end()
    return moment


def server_killed(ground: Ground, place: Place, chance: random.Random) -> str:
    """kill -9 of Prefect's server and its keeper; the run goes on as well as it can."""
    command, moment = at_random_moment(ground, place, chance)
    for pid in server_pids(ground):
        kill(pid)
    return f"{moment}; {ended(command)}"


def hung(ground: Ground, place: Place, chance: random.Random) -> str:
    """A worker process hangs (SIGSTOP): the image's time ends it."""
    command, moment = at_random_moment(ground, place, chance, "--image-timeout-s", "4", "--retries", "0")
    for pid in command.workers():
        kill(pid, signal.SIGSTOP)
    return f"{moment}; {ended(command)}"


def disk_full(ground: Ground, place: Place, chance: random.Random) -> str:
    """The disk of store and cache is full half-way."""
    size_kb = SMALLEST_DISK_KB + chance.randrange(SMALLEST_DISK_KB)
    if not mounted(place.folder, size_kb):
        return f"no disk could be mounted; {files_limited(ground, place, chance)}"
    return f"{size_kb} kB; {ended(ground.start(place, '--retries', '1'))}"


def files_limited(ground: Ground, place: Place, _: random.Random) -> str:
    """No file may grow beyond a few kB (as a quota does it)."""
    return ended(ground.start(place, "--retries", "1", limit_bytes=LIMIT_BYTES))


def run_twice_at_once(ground: Ground, place: Place, _: random.Random) -> str:
    """Two runs of the same list into the same store at the same time."""
    return " and ".join(ended(command) for command in [ground.start(place) for _ in range(2)])


def dask_worker_killed(ground: Ground, place: Place, chance: random.Random) -> str:
    """kill -9 of a worker of a Dask cluster on this machine; Dask gives its image to another one."""
    command = ground.start(place, "--runner", "dask")
    found = wait_for(lambda: command.has_ended or bool(command.dask_workers()))
    workers = command.dask_workers()
    if not found or not workers:
        return f"no Dask worker was at work; {ended(command)}"
    wait_for(lambda: command.has_ended, chance.uniform(0.0, LITTLE_S))
    kill(chance.choice(workers))
    return ended(command)


SINGLE: dict[str, Disturb] = {
    "disk full": disk_full,
    "file size limited": files_limited,
    "server killed": server_killed,
    "worker hangs": hung,
    "two runs at once": run_twice_at_once,
    "Dask worker killed": dask_worker_killed,
}
KILLS: dict[str, Disturb] = {
    "worker kill -9": worker_killed,
    "flow kill -9": command_killed,
    "all kill -9": all_killed,
}


def at_random_moment(ground: Ground, place: Place, chance: random.Random, *options: str) -> tuple[Command, str]:
    """A command, started and let work until it has begun so many steps and a little longer, and that in words."""
    command = ground.start(place, *options)
    begun, more_s = chance.randrange(1, ground.steps), chance.uniform(0.0, LITTLE_S)
    wait_for(lambda: command.has_ended or len(command.stamps["step"]) >= begun)
    wait_for(lambda: command.has_ended, more_s)
    moment = f"{more_s:.2f} s into step {begun} of {ground.steps}"
    return command, moment + (" (HAD ENDED)" if command.has_ended else "")


def ended(command: Command) -> str:
    """How a command ended, in words."""
    started = time.monotonic()
    try:
        status = command.await_end(PATIENCE_S)
    except subprocess.TimeoutExpired:
        command.kill()
        return "HUNG, was killed"
    summary = command.summary
    if summary is None:
        reported = [event["text"] for event in command.events if event.get("level") == "error"] or command.noise
        return f"exit {status} after {time.monotonic() - started:.1f} s: {' '.join(reported[-1:])[:160]}"
    counts = ", ".join(f"{count} {name}" for name, count in summary["status"].items() if count)
    codes = ", ".join(summary["codes"])
    return f"exit {status}: {counts}" + (f" ({codes})" if codes else "")


def server_pids(ground: Ground) -> list[int]:
    """Keeper and server of the ground's Prefect."""
    try:
        record = json.loads((ground.folder / "state" / "server" / "server.json").read_text())
    except (OSError, ValueError):
        return []
    return [record["keeper_pid"], record["server_pid"]]


def mounted(folder: Path, size_kb: int) -> bool:
    """Put a small disk of memory at `folder`; False where that is not allowed."""
    if not hasattr(os, "geteuid") or os.geteuid() != 0:
        return False
    command = ["mount", "-t", "tmpfs", "-o", f"size={size_kb}k", "tmpfs", str(folder)]
    return subprocess.run(command, capture_output=True, check=False).returncode == 0


@contextmanager
def disks_taken_down(folder: Path) -> Iterator[None]:
    """After the `with` block no small disk is at `folder` any more."""
    try:
        yield
    finally:
        if folder.is_mount():
            subprocess.run(["umount", str(folder)], capture_output=True, check=False)


def enlarge(folder: Path) -> None:
    """Give a small disk enough room."""
    if folder.is_mount():
        subprocess.run(["mount", "-o", "remount,size=2g", str(folder)], capture_output=True, check=False)
