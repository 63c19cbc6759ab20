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
from flows.reprocessing.settings import Settings
from flows.verdict import PUBLISHED

STEPS = 12  # of an image, about: the length of its bar


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
        """Write one record."""
        product = getattr(record, "product", None)
        self._lines.write(record.levelname.lower(), "log", product=product, text=self.format(record))


@contextmanager
def telling(settings: Settings, quiet: bool, as_json: bool) -> Iterator[Reporter]:
    """The reporter of a run."""
    if not as_json:
        from catalog.lists import load_image_list

        total = len(load_image_list(settings.images).entries)
        with reporter(total, STEPS, quiet) as told:
            yield told
        return
    lines, logger = JsonLines(), logging.getLogger("planetpose")
    handler = JsonHandler(lines)
    logger.addHandler(handler)
    try:
        yield lines
    finally:
        logger.removeHandler(handler)
