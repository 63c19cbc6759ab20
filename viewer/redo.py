"""Doing an image again, with the help that was given, in a process of its own: the server stays small and quick."""

import json
import subprocess
import sys
import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import planetpose_launcher
from catalog.errors import RefusedError
from catalog.reasons import Reason

MOST_JOBS = 50
LINES = 30


@dataclass
class Job:
    """One image that is done again. lines: what happens, the latest last. status: running, or as results have it."""

    number: int
    product: str
    status: str = "running"
    reason: str | None = None
    step: str = ""
    done: list[str] = field(default_factory=list)
    lines: list[str] = field(default_factory=list)
    result: dict[str, Any] | None = None

    def take(self, message: dict[str, Any]) -> None:
        """Note a message of the process."""
        if message["kind"] == "step":
            if message["step"] != self.step:
                self.done += [self.step] if self.step else []
                self.step = message["step"]
            if message["text"]:
                self.lines = [*self.lines, f"{message['step']} {message['iteration']}: {message['text']}"][-LINES:]
        elif message["kind"] == "end":
            self.result = message["result"]

    def end(self, fault: str) -> None:
        """Set status and reason: those of the result, or failed with `fault` where the process left none."""
        known = self.result or {"status": "failed", "reason": fault}
        self.reason, self.status = known["reason"], known["status"]


class Jobs:
    """Images that are done again: one at a time, the others wait."""

    def __init__(self, store: Path, ended: Callable[[Job], None]) -> None:
        self.store, self._ended = Path(store), ended
        self._turn, self._lock = threading.Lock(), threading.Lock()
        self._jobs: dict[int, Job] = {}

    def start(self, product: str) -> Job:
        """Do a product again. Raises RefusedError when it is being done."""
        with self._lock:
            if any(job.product == product and job.status == "running" for job in self._jobs.values()):
                raise RefusedError(Reason.PRODUCT_PLACE_TAKEN, f"{product} is being done.", "Wait for it.")
            job = Job(len(self._jobs) + 1, product)
            self._jobs[job.number] = job
        threading.Thread(target=self._run, args=(job,), daemon=True, name=f"redo {product}").start()
        return job

    def of(self, number: int) -> Job | None:
        """A job by its number."""
        return self._jobs.get(number)

    def _run(self, job: Job) -> None:
        with self._turn:
            launcher = Path(planetpose_launcher.__file__)
            command = [sys.executable, "-P", str(launcher), "-m", "viewer.redo_process", str(self.store), job.product]
            with subprocess.Popen(
                command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
            ) as process:
                errors: list[str] = []
                reader = threading.Thread(target=lambda: errors.extend(process.stderr or ()), daemon=True)
                reader.start()
                for line in process.stdout or ():
                    job.take(json.loads(line))
                reader.join()
        self._ended(job)  # whoever sees that the job is over sees its product
        job.end(f"the process ended with {process.returncode}: {''.join(errors[-3:]).strip()}")
