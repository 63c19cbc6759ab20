"""A process that corrects one image after the other: python -m flows.reprocessing.worker

Jobs come as lines of JSON on stdin, messages go as lines of JSON to stdout; whatever else is printed goes to stderr. It
ends with its parent: when stdin ends, in the middle of a step too. It knows no Prefect: the image is Prefect's task.
"""

import json
import logging
import os
import sys
import threading
import time
from pathlib import Path
from queue import SimpleQueue
from typing import Any, TextIO

from catalog.digest import remember_digests
from flows.boundary import trouble_of
from flows.chain import Chain
from flows.image import correct_image
from flows.reprocessing.claims import claimed
from flows.reprocessing.faults import can_pass
from flows.reprocessing.memory import give_back, peak_mb, reset_peak, resident_mb
from flows.request import Request
from flows.result import result_of
from flows.trace import trace_of
from tasks.record import RECORD_FILE, Record
from tasks.registry import PUBLISH
from tasks.step import AnyStep, run

logger = logging.getLogger("planetpose")


class Voice:
    """Says what happens, one JSON object per line; from several threads."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._lock = threading.Lock()

    def say(self, kind: str, **content: Any) -> None:
        """One message."""
        with self._lock:
            self._stream.write(json.dumps({"kind": kind, **content}) + "\n")
            self._stream.flush()


class Telling(logging.Handler):
    """Log records as messages."""

    def __init__(self, voice: Voice) -> None:
        super().__init__()
        self._voice = voice

    def emit(self, record: logging.LogRecord) -> None:
        """Pass one record on, its traceback included."""
        self._voice.say("log", level=record.levelname, text=self.format(record))


def main() -> int:
    """Do jobs until stdin ends."""
    voice = Voice(os.fdopen(os.dup(1), "w", encoding="utf-8"))
    os.dup2(2, 1)
    logger.addHandler(Telling(voice))
    logger.propagate = False
    jobs: SimpleQueue[str] = SimpleQueue()
    threading.Thread(target=listen, args=(jobs,), daemon=True, name="listen").start()
    job = json.loads(jobs.get())
    remember_digests(Path(job["digests"]))
    limit_renderer(int(job.get("threads", 1)))
    while True:
        do(Request.model_validate(job["request"]), voice)
        job = json.loads(jobs.get())


def limit_renderer(threads: int) -> None:
    """Mitsuba's own threads, which no variable of the environment limits."""
    import drjit

    drjit.set_thread_count(threads)


def listen(jobs: "SimpleQueue[str]") -> None:
    """Pass jobs on; end the process when nobody can send any more."""
    for line in sys.stdin:
        jobs.put(line)
    os._exit(0)


def do(request: Request, voice: Voice) -> None:
    """Correct one image and say how it ended."""
    with claimed(request.store, request.product, lambda: voice.say("waiting")):
        voice.say("begin")
        started, worked = time.perf_counter(), time.process_time()
        metrics: dict[str, dict[str, Any]] = {}
        chain = Chain(request, lambda step: measured(step, voice, metrics))
        error = correct(chain)
        result, passing = result_of(chain, error), error is not None and can_pass(error)
        for sentence in (*result["guidance"]["overruled"], *result["warnings"]):
            logger.warning("%s: %s", request.product, sentence)
    give_back()
    voice.say(
        "end",
        result=result,
        key=product.key if (product := chain.last(PUBLISH)) else None,
        passing=passing,
        trace=trace_of(chain, failures=not passing),
        steps=metrics,
        seconds=round(time.perf_counter() - started, 3),
        cpu_s=round(time.process_time() - worked, 3),
        resident_mb=resident_mb(),
    )


def correct(chain: Chain) -> Exception | None:
    """All steps of one image; what ended them, if anything did."""
    return trouble_of(lambda: correct_image(chain), chain.request.product)


def measured(step: AnyStep, voice: Voice, metrics: dict[str, dict[str, Any]]) -> Record:
    """Run a step, say so, and note its seconds and peak of memory; a cached one is marked as used."""

    def progress(_: str, iteration: int, text: str) -> None:
        voice.say("step", step=step.name, iteration=iteration, text=text)

    voice.say("step", step=step.name, iteration=0, text="", folder=str(step.folder.parent))
    finished = step.record()
    if finished is not None:
        mark_as_used(step.folder)
        metrics[step.name] = {"seconds": finished.seconds, "peak_mb": None, "cached": True}
        voice.say("done", step=step.name, **metrics[step.name])
        return finished
    reset_peak()
    started = time.perf_counter()
    try:
        return run(step, progress)
    finally:
        seconds = round(time.perf_counter() - started, 4)
        metrics[step.name] = {"seconds": seconds, "peak_mb": peak_mb(), "cached": False}
        voice.say("done", step=step.name, **metrics[step.name])


def mark_as_used(folder: Path) -> None:
    """Tell the pruning of the cache that this step is still in use."""
    try:
        os.utime(folder / RECORD_FILE)
    except OSError:  # gone meanwhile, or somebody else's: then it is not marked
        return


if __name__ == "__main__":
    sys.exit(main())
