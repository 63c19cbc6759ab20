"""What the user sees on stderr while images are corrected: a live display on a terminal, plain lines elsewhere, or JSON
lines for a machine."""

import json
import logging
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol, TextIO

from catalog.times import now_utc
from local_server.reachable import quietly

if TYPE_CHECKING:
    from rich.progress import TaskID

STEPS_LOGGER = "planetpose-steps"  # a tree of its own: Prefect would keep a row for every step
STEPS = 12  # of an image, about: the length of its bar
FIGURES = ("product", "step", "seconds", "peak_mb", "cached")  # of log records, beside their text
logger = logging.getLogger("planetpose")


class Reporter(Protocol):
    """Hears what happens; called from several threads."""

    def message(self, product: str, step: str, iteration: int, text: str) -> None:
        """An iteration inside a step (0: the step begins)."""

    def finished(self, product: str, status: str, reason: str | None) -> None:
        """An image has ended."""


class Silent:
    """Shows nothing."""

    def message(self, product: str, step: str, iteration: int, text: str) -> None:
        """Nothing."""

    def finished(self, product: str, status: str, reason: str | None) -> None:
        """Nothing."""


class Lines:
    """One plain line per event, with the seconds since the start."""

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream = stream or sys.stderr
        self._start = time.monotonic()
        self._lock = threading.Lock()

    def message(self, product: str, step: str, iteration: int, text: str) -> None:
        """`  1.2 s  C0552809300R  point-1  iteration 3: moved 0.04 px`."""
        self._write(f"{product}  {step}" + (f"  iteration {iteration}: {text}" if iteration or text else ""))

    def finished(self, product: str, status: str, reason: str | None) -> None:
        """`  3.4 s  C0552809300R  ok`."""
        self._write(f"{product}  {status}" + (f"  {reason}" if reason else ""))

    def _write(self, text: str) -> None:
        with self._lock:
            print(f"{time.monotonic() - self._start:7.1f} s  {text}", file=self._stream, flush=True)


class Live:
    """A bar per image in work, with its step and iteration, and one for all of them; finished images become lines
    above."""

    def __init__(self, total: int, steps: int) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

        columns = (TextColumn("{task.fields[product]}"), BarColumn(20), TextColumn("{task.description}"))
        self._progress = Progress(*columns, TimeElapsedColumn(), console=Console(stderr=True), transient=True)
        self._steps = steps
        self._total = total
        self._done = 0
        self._rows: dict[str, tuple[TaskID, set[str]]] = {}
        self._counts: Counter[str] = Counter()
        self._all = self._progress.add_task("", total=total, product="all images") if total > 1 else None
        self._lock = threading.Lock()

    def __enter__(self) -> "Live":
        self._progress.start()
        return self

    def __exit__(self, *exception: object) -> None:
        self._progress.stop()

    def message(self, product: str, step: str, iteration: int, text: str) -> None:
        """Move the image's bar on when the step is new, and show the iteration."""
        with self._lock:
            if product not in self._rows:
                row = self._progress.add_task("", total=self._steps, product=product)
                self._rows[product] = (row, set())
            row, seen = self._rows[product]
            seen.add(step)
            detail = f"{step}  {iteration}: {text}" if text else step
            self._progress.update(row, completed=len(seen) - 1, description=detail)

    def finished(self, product: str, status: str, reason: str | None) -> None:
        """Replace the bar by a line."""
        from rich.text import Text

        with self._lock:
            self._done += 1
            self._counts[status] += 1
            if self._all is not None:
                counts = ", ".join(f"{times} {name}" for name, times in self._counts.most_common())
                self._progress.update(
                    self._all, completed=self._done, description=f"{self._done}/{self._total}  {counts}"
                )
            if product in self._rows:
                self._progress.remove_task(self._rows.pop(product)[0])
            count = f"{self._done}/{self._total}  " if self._total > 1 else ""
            colour = {"ok": "green", "doubtful": "yellow", "refused": "yellow"}.get(status, "red")
            line = Text.assemble(f"{count}{product}  ", (status, colour), f"  {reason}" if reason else "")
            self._progress.console.print(line)


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
        level = "info" if status in ("ok", "doubtful") else "warning"
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
def json_reporter() -> Iterator[JsonLines]:
    """JSON lines on stderr for progress and log."""
    lines = JsonLines()
    handler, steps = JsonHandler(lines), logging.getLogger(STEPS_LOGGER)
    steps.setLevel(logging.INFO)
    steps.propagate = False
    for each in (logger, steps):
        each.addHandler(handler)
    try:
        yield lines
    finally:
        for each in (logger, steps):
            each.removeHandler(handler)


@dataclass(frozen=True)
class Audience:
    """Who in this process hears of progress, and of results; no parameter of a flow, for it cannot travel."""

    reporter: Reporter
    on_result: Callable[[dict[str, Any]], None]


_nobody = Audience(Silent(), lambda _: None)
_audience: ContextVar[Audience | None] = ContextVar("audience", default=None)


@contextmanager
def reporting_to(reporter: Reporter, on_result: Callable[[dict[str, Any]], None]) -> Iterator[None]:
    """Within the `with` block, flows of this process report to these two."""
    token = _audience.set(Audience(reporter, on_result))
    try:
        yield
    finally:
        _audience.reset(token)


def audience() -> Audience:
    """Who hears of progress and results."""
    return _audience.get() or _nobody


@contextmanager
def reporter(total: int, steps: int = STEPS, quiet: bool = False) -> Iterator[Reporter]:
    """The reporter that suits stderr: live on a terminal, lines elsewhere, silent when it is to be quiet."""
    if quiet:
        with quietly():
            yield Silent()
    elif sys.stderr.isatty():
        with Live(total, steps) as live:
            yield live
    else:
        yield Lines()
