"""Small steps that leave a trace when they work: read -> double -> publish."""

import os
import time
from dataclasses import dataclass
from pathlib import Path

from catalog.errors import FailedError, RefusedError
from tasks.fields import Content
from tasks.step import StepType
from tasks.work import NoFiles, Work


def done(log: Path) -> list[str]:
    """Names of the steps that worked, in order; the log is emptied."""
    names = log.read_text().split()
    log.write_text("")
    return names


def note(name: str) -> None:
    """Leave a trace."""
    with open(os.environ["FAKE_STEPS_LOG"], "a") as log:
        log.write(f"{name}\n")


class Number(Content):
    """What a step comes to."""

    number: float


class ReadInputs(Content):
    """What the result depends on."""

    image: str
    n: float = 1.0


@dataclass(frozen=True)
class ImageFile:
    """Where the number is."""

    image: Path


def read(inputs: ReadInputs, files: ImageFile, _: Work) -> Number:
    """The number in a file; some words stand for trouble."""
    note("read")
    text = files.image.read_text().strip()
    if text == "refuse":
        raise RefusedError("no-number", f"image {files.image} holds no number.", "Write one.")
    if text == "fail":
        raise FailedError("did-not-converge", "it went round in circles.")
    if text == "bug":
        raise ZeroDivisionError("nobody thought of this")
    if text == "disk":
        raise OSError(28, "No space left on device")
    return Number(number=float(text) * inputs.n)


class DoubleInputs(Content):
    """What the result depends on."""

    before: str
    number: float
    setting: float


def double(inputs: DoubleInputs, _: NoFiles, work: Work) -> Number:
    """Twice the number of the step before, times a setting."""
    note("double")
    work.progress("double", 1, "doubling")
    return Number(number=2 * inputs.number * inputs.setting)


class PublishInputs(Content):
    """What the product depends on."""

    before: str


class Product(Content):
    """What was published."""

    product: str


def publish(_: PublishInputs, __: NoFiles, work: Work) -> Product:
    """A product of one file."""
    note("publish")
    (work.folder / "product.txt").write_text("whole")
    return Product(product="product.txt")


@dataclass(frozen=True)
class Signs:
    """Files by which the step and its test talk."""

    started: Path
    go_on: Path


class Process(Content):
    """Who did it."""

    pid: int


def slow(_: Content, files: Signs, work: Work) -> Process:
    """Write half, tell the test, wait to be killed or until the file `go_on` exists."""
    note("slow")
    (work.folder / "half.txt").write_text("half")
    files.started.touch()
    while not files.go_on.exists():
        time.sleep(0.01)
    return Process(pid=os.getpid())


READ = StepType("read", read, Number)
DOUBLE = StepType("double", double, Number)
PUBLISH = StepType("publish", publish, Product)
SLOW = StepType("slow", slow, Process)
