"""Who hears of a run: a person at a terminal or with a log file, or a machine that reads JSON lines."""

import json
import logging
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, TextIO

from catalog.times import now_utc
from flows.progress import Reporter, reporter
from flows.reprocessing.one_image import STEPS_LOGGER
from flows.verdict import PUBLISHED

STEPS = 12  # of an image, about: the length of its bar
FIGURES = ("product", "step", "seconds", "peak_mb", "cached")  # of log records, beside their text


class JsonLines:
    """One JSON object per event: time, level, event, product, and what belongs to it. Steps' iterations are left out;
    their beginnings are not."""

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream = stream or sys.stderr
        self._lock = threading.Lock()

    def message(self, product: str, step: str, iteration: int, text: str) -> None:
        """A step begins."""
        if iteration == 0 and not text:
            self.write("info", "step", product=product, step=step)

    def finished(self, product: str, status: str, reason: str | None) -> None:
        """An image has ended."""
        level = "info" if status in PUBLISHED else "warning"
        self.write(level, "finished", product=product, status=status, reason=reason)

    def write(self, level: str, event: str, **content: Any) -> None:
        """One line."""
        line = json.dumps({"time": now_utc(), "level": level, "event": event, **content}, default=str)
        with self._lock:
            print(line, file=self._stream, flush=True)


class JsonHandler(logging.Handler):
    """Log records as JSON lines, with the product that they are about."""

    def __init__(self, lines: JsonLines) -> None:
        super().__init__()
        self._lines = lines

    def emit(self, record: logging.LogRecord) -> None:
        """Write one record; figures that belong to it become fields of their own."""
        known = {name: getattr(record, name) for name in FIGURES if hasattr(record, name)}
        event = "step-done" if "step" in known else "log"
        self._lines.write(record.levelname.lower(), event, **known, text=self.format(record))


@contextmanager
def telling(images: int, quiet: bool, as_json: bool) -> Iterator[Reporter]:
    """The reporter of a run of so many images."""
    if not as_json:
        with reporter(images, STEPS, quiet) as told:
            yield told
        return
    lines = JsonLines()
    handler, steps = JsonHandler(lines), logging.getLogger(STEPS_LOGGER)
    listened = (logging.getLogger("planetpose"), steps)
    steps.setLevel(logging.INFO)
    steps.propagate = False
    for logger in listened:
        logger.addHandler(handler)
    try:
        yield lines
    finally:
        for logger in listened:
            logger.removeHandler(handler)
