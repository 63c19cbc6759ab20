"""Small steps that leave a trace when they work: read -> double -> publish."""

import os
import time
from pathlib import Path
from typing import Any

from catalog.errors import FailedError, RefusedError
from tasks.work import Work


def done(log: Path) -> list[str]:
    """Names of the steps that worked, in order; the log is emptied."""
    names = log.read_text().split()
    log.write_text("")
    return names


def run(work: Work) -> dict[str, Any]:
    """What `inputs["do"]` says."""
    with open(os.environ["FAKE_STEPS_LOG"], "a") as log:
        log.write(f"{work.inputs['do']}\n")
    return {"read": read, "double": double, "publish": publish, "slow": slow}[work.inputs["do"]](work)


def read(work: Work) -> dict[str, Any]:
    """The number in a file; some words stand for trouble."""
    text = work.place("image").read_text().strip()
    if text == "refuse":
        raise RefusedError("no-number", f"image {work.places['image']} holds no number.", "Write one.")
    if text == "fail":
        raise FailedError("did-not-converge", "it went round in circles.")
    if text == "bug":
        raise ZeroDivisionError("nobody thought of this")
    if text == "disk":
        raise OSError(28, "No space left on device")
    return {"number": float(text)}


def double(work: Work) -> dict[str, Any]:
    """Twice the number of the step before, times a setting."""
    from tasks.record import record_in

    work.progress("double", 1, "doubling")
    number = record_in(work.place("before")).result["number"]
    return {"number": 2 * number * work.inputs["setting"]}


def publish(work: Work) -> dict[str, Any]:
    """A product of one file."""
    (work.folder / "product.txt").write_text("whole")
    return {"product": "product.txt"}


def slow(work: Work) -> dict[str, Any]:
    """Write half, tell the test, wait to be killed or until the file `go_on` exists."""
    (work.folder / "half.txt").write_text("half")
    Path(work.places["started"]).touch()
    while not Path(work.places["go_on"]).exists():
        time.sleep(0.01)
    return {"pid": os.getpid()}
