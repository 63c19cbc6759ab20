"""stdout for the answer and nothing else."""

import json
import logging
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NoReturn, TextIO


@contextmanager
def clean_stdout() -> Iterator[TextIO]:
    """Yield a stream to the real stdout; within the `with` block whatever else is printed, by C libraries too, goes to
    stderr."""
    sys.stdout.flush()
    answer = os.fdopen(os.dup(1), "w", encoding="utf-8", errors="backslashreplace")
    os.dup2(2, 1)
    try:
        yield answer
    finally:
        answer.flush()
        sys.stdout.flush()
        os.dup2(answer.fileno(), 1)
        answer.close()


def write_json(stream: TextIO, content: Any) -> None:
    """One JSON value on one line, at once."""
    stream.write(json.dumps(content, allow_nan=False) + "\n")
    stream.flush()


def log_to_stderr() -> None:
    """Warnings and tracebacks of this program go to stderr."""
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(logging.Formatter("planetpose: %(levelname)s: %(message)s"))
    logging.getLogger("planetpose").addHandler(handler)


def end_process(status: int) -> NoReturn:
    """End with this exit status; without Prefect's farewell when nobody is there to hear it."""
    from local_server.prefect_settings import server_is_lost

    sys.stdout.flush()
    sys.stderr.flush()
    if server_is_lost():
        os._exit(status)
    sys.exit(status)
