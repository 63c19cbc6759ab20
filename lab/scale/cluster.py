"""A Dask scheduler and workers as processes that share no folder, and the command that hands them images."""

import os
import shutil
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

import psutil

from catalog.children import our_command, their_module
from lab.rehearsal.processes import Session, descendants, wait_until
from local_server.server import free_port

ONE_THREAD = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL", "NUMBA")}
QUIET = {"DASK_DISTRIBUTED__WORKER__PROFILE__ENABLED": "False"}
OWN = {"PLANETPOSE_STATE": "state", "PLANETPOSE_CACHE": "cache", "PLANETPOSE_ARCHIVE": "archive", "TMPDIR": "tmp"}


def machine(folder: Path, environment: Mapping[str, str]) -> dict[str, str]:
    """Environment of a process on a machine of its own: its home, working folder and folders of planetpose are below
    `folder`."""
    for name in (*OWN.values(), "home"):
        (folder / name).mkdir(parents=True, exist_ok=True)
    own = {name: str(folder / place) for name, place in OWN.items()}
    home = {"HOME": str(folder / "home"), "PLANETPOSE_KERNELS": ""}
    return {**os.environ, **environment, **ONE_THREAD, **QUIET, **own, **home}


class Cluster:
    """The scheduler and its workers, each in a folder of its own below `folder`."""

    def __init__(self, folder: Path, environment: Mapping[str, str], workers: int) -> None:
        self._folder, self._environment = folder, dict(environment)
        self._port = free_port()
        self.address = f"tcp://127.0.0.1:{self._port}"
        self.scheduler = self._scheduler()
        self.workers = [self._worker(number) for number in range(workers)]

    def lose_worker(self, number: int) -> None:
        """kill -9 a worker and what it started; a new one with empty folders comes in its place."""
        self.workers[number].lose()
        shutil.rmtree(self._folder / f"worker-{number}")
        self.workers[number] = self._worker(number)

    def lose_scheduler(self) -> None:
        """kill -9 the scheduler; a new one, which knows nothing, comes in its place. Workers end with it."""
        self.scheduler.lose()
        self.scheduler = self._scheduler()

    def tend(self) -> None:
        """Start workers anew that have ended, as a service manager does."""
        for number, worker in enumerate(self.workers):
            if worker.process.poll() is not None:
                worker.lose()
                self.workers[number] = self._worker(number)

    def processor_s(self) -> float:
        """Processor seconds of the workers that run and of what they started and is not at work any more."""
        return sum(processor_s_of(worker.process.pid) for worker in self.workers)

    def end(self) -> None:
        """End all."""
        for session in (*self.workers, self.scheduler):
            session.lose()

    def _scheduler(self) -> Session:
        place = self._folder / "scheduler"
        command = their_module(
            "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", str(self._port), "--no-dashboard"
        )
        session = Session(command, machine(place, self._environment), self._folder / "scheduler.log", place)
        wait_until("the scheduler", lambda: "Scheduler at" in session.log.read_text(), 60)
        return session

    def _worker(self, number: int) -> Session:
        place = self._folder / f"worker-{number}"
        environment = machine(place, self._environment)
        command = their_module(
            "distributed.cli.dask_worker", self.address, "--nthreads", "1", "--no-nanny", "--no-dashboard",
            "--local-directory", str(place / "tmp"), "--death-timeout", "600",
        )  # fmt: skip
        return Session(command, environment, self._folder / f"worker-{number}.log", place)


def processor_s_of(pid: int) -> float:
    """Processor seconds, user and system, of a process and all below it, those that ended included."""
    total = 0.0
    for each in (pid, *descendants(pid)):
        with suppress(psutil.NoSuchProcess):
            times = psutil.Process(each).cpu_times()
            total += times.user + times.system + times.children_user + times.children_system
    return total


def reprocess(folder: Path, environment: Mapping[str, str], arguments: list[str]) -> Session:
    """`planetpose reprocess`, on a machine of its own too."""
    command = our_command("reprocess", *arguments, "--json", "--quiet")
    return Session(command, machine(folder, environment), folder.parent / "reprocess.log", folder)
