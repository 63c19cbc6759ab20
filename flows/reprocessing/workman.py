"""A worker process seen from its parent: it is given one image at a time, and killed when it takes too much."""

import json
import os
import signal
import subprocess
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any

from flows.children import our_module
from flows.reprocessing.memory import resident_mb
from flows.reprocessing.settings import Limits
from tasks.atomic import sweep_temporaries

Message = dict[str, Any]
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS", "OPENCV_FOR_THREADS_NUM")
LOOK_EVERY_S = 1.0
END_TIMEOUT_S = 5.0


class LostError(Exception):
    """The worker did not bring an image to its end. code: `timed-out`, `memory` or `worker-died`."""

    def __init__(self, code: str, text: str) -> None:
        self.code = code
        super().__init__(f"{code}: {text}")


class Workman:
    """One worker process. threads: that its libraries may use. module: what it runs."""

    def __init__(self, threads: int = 1, module: str = "flows.reprocessing.worker") -> None:
        environment = {**os.environ, **dict.fromkeys(THREADS, str(threads))}
        self._process = subprocess.Popen(
            our_module(module),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=environment,
            text=True,
            encoding="utf-8",
            start_new_session=True,  # an interrupted command ends it in its own way
        )
        self._messages: SimpleQueue[Message | None] = SimpleQueue()
        self._folders: set[Path] = set()
        self._listener = threading.Thread(target=self._listen, daemon=True, name="worker-messages")
        self._listener.start()

    @property
    def pid(self) -> int:
        """The process's number."""
        return self._process.pid

    @property
    def is_alive(self) -> bool:
        """Whether the process runs."""
        return self._process.poll() is None

    def do(self, job: Mapping[str, Any], limits: Limits, tell: Callable[[Message], None]) -> Message:
        """The worker's last message about a job; `tell` is called with those before it. Raises LostError when there is
        none: the process died, or took too much time or memory; it is dead then, and what it left is swept away."""
        self._folders.clear()
        ended = False
        try:
            end = self._await_end(job, limits, tell)
            ended = True
        finally:
            if not ended:
                self.kill()
        return end

    def _await_end(self, job: Mapping[str, Any], limits: Limits, tell: Callable[[Message], None]) -> Message:
        step = "start"
        self._send(job)
        deadline, next_look = time.monotonic() + limits.image_timeout_s, 0.0
        while True:
            message = self._next_message()
            if message is None:
                raise LostError("worker-died", f"the process died in step {step} ({self._how_it_ended()}).")
            kind = message.get("kind")
            if kind == "end":
                return message
            if kind in ("begin", "waiting"):  # the wait for another process is not the image's
                deadline = time.monotonic() + limits.image_timeout_s
            elif kind == "step":
                step = message["step"]
                if "folder" in message:
                    self._folders.add(Path(message["folder"]))
            if kind != "idle":
                tell(message)
            now = time.monotonic()
            if now > deadline:
                text = f"step {step} was at work when the image's {limits.image_timeout_s:g} s were over"
                raise LostError("timed-out", f"{text}; its process was killed.")
            if now >= next_look:
                next_look = now + LOOK_EVERY_S
                self._check_memory(step, limits.image_memory_mb)

    def _check_memory(self, step: str, allowed_mb: float) -> None:
        used_mb = resident_mb(self.pid)
        if used_mb is not None and used_mb > allowed_mb:
            text = f"step {step} took {used_mb:.0f} MB, allowed {allowed_mb:.0f} MB"
            raise LostError("memory", f"{text}; its process was killed.")

    def _send(self, job: Mapping[str, Any]) -> None:
        if self._process.stdin is None:
            raise LostError("worker-died", "the process cannot be spoken to.")
        try:
            self._process.stdin.write(json.dumps(job) + "\n")
            self._process.stdin.flush()
        except OSError as error:
            raise LostError("worker-died", f"the process was gone before the image began ({error}).") from error

    def _next_message(self) -> Message | None:
        try:
            return self._messages.get(timeout=LOOK_EVERY_S)
        except Empty:
            return {"kind": "idle"}

    def _listen(self) -> None:
        """Pass on what the worker says; None when it has said its last."""
        stream = self._process.stdout
        for line in stream or ():
            with suppress(ValueError):  # half a line of a killed process
                self._messages.put(json.loads(line))
        self._messages.put(None)

    def _how_it_ended(self) -> str:
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(END_TIMEOUT_S)
        code = self._process.poll()
        if code is None:
            return "it closed its output"
        return f"signal {signal.Signals(-code).name}" if code < 0 else f"exit status {code}"

    def kill(self) -> None:
        """End the process and all that it started, now, and delete the temporaries that it leaves."""
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(self.pid, signal.SIGKILL)
        self._process.wait()
        self._close()
        for folder in self._folders:
            sweep_temporaries(folder)

    def end(self) -> None:
        """End the process, which has nothing to do."""
        self._hang_up()
        try:
            self._process.wait(END_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            self.kill()
        self._close()

    def _hang_up(self) -> None:
        if self._process.stdin is not None:
            with suppress(OSError):
                self._process.stdin.close()

    def _close(self) -> None:
        """Let go of the pipes of a process that has ended."""
        self._hang_up()
        self._listener.join(END_TIMEOUT_S)
        if self._process.stdout is not None and not self._listener.is_alive():
            self._process.stdout.close()
