"""A reader in a process of its own, that reads on request, is timed, and replaced when it crashes or hangs."""

import json
import os
import select
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Any

from catalog.children import our_module

READER = tuple(our_module("lab.fuzz.child"))
START_TIMEOUT_S = 300.0  # of a busy machine
SINGLE_THREAD = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL", "NUMBA")}


class ReaderProcess:
    """Answers of `lab.fuzz.child`; use it in a `with` block."""

    def __init__(self, timeout_s: float, memory_bytes: int, command: tuple[str, ...] = READER) -> None:
        self._timeout_s, self._command = timeout_s, [*command, str(memory_bytes)]
        self._process: subprocess.Popen[str] | None = None

    def __enter__(self) -> "ReaderProcess":
        self._errors = tempfile.TemporaryFile("w+")
        return self

    def __exit__(self, *_: object) -> None:
        self._end()
        self._errors.close()

    def ask(self, path: Path) -> dict[str, Any]:
        """The child's answer about a file, as `put`."""
        return self.put(str(path))

    def put(self, question: Any) -> dict[str, Any]:
        """The child's answer with its seconds; outcome `hang` after the timeout, `crash` when the process ended."""
        process = self._process or self._start()
        started = time.monotonic()
        line = self._exchange(process, json.dumps(question), self._timeout_s)
        seconds = time.monotonic() - started
        if line:
            return {"seconds": seconds, **json.loads(line)}
        hung = process.poll() is None and seconds >= self._timeout_s
        self._end()
        return {"outcome": "hang" if hung else "crash", "reason": self._last_words(), "seconds": seconds}

    def _start(self) -> "subprocess.Popen[str]":
        self._errors.seek(0)
        self._errors.truncate()
        self._process = subprocess.Popen(
            self._command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            text=True,
            env={**os.environ, **SINGLE_THREAD},
        )
        if not self._exchange(self._process, None, START_TIMEOUT_S):
            raise RuntimeError(f"the reader's process does not start: {self._last_words()}")
        return self._process

    def _exchange(self, process: "subprocess.Popen[str]", question: str | None, timeout_s: float) -> str:
        """The next line, "" when the process ended or was silent for too long."""
        if process.stdin is None or process.stdout is None:
            raise RuntimeError("the reader's process has no pipes")
        try:
            if question is not None:
                process.stdin.write(question + "\n")
                process.stdin.flush()
        except BrokenPipeError:
            return ""
        ready, _, _ = select.select([process.stdout], [], [], timeout_s)
        return process.stdout.readline() if ready else ""

    def _end(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            for stream in (self._process.stdin, self._process.stdout):
                if stream is not None:
                    stream.close()
        self._process = None

    def _last_words(self) -> str:
        self._errors.seek(0)
        return self._errors.read()[-2000:].strip()
