"""Examples in Markdown that are run: fenced blocks after a line `<!-- run: WORLD -->`.

A `python` block is executed, those of a page in one namespace; a `sh` block is run line by line; a `console` block has
its commands after `$ ` and what they print. A `text` block right after a `python` block is what that prints. Printed
numbers may differ a little (`alike`), and `...` stands for anything.
"""

import contextlib
import io
import re
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

BLOCK = re.compile(
    r"^<!-- run: (?P<world>\S+) -->\n```(?P<language>\w+)\n(?P<code>.*?)^```\n(?:\n```text\n(?P<printed>.*?)^```$)?",
    re.M | re.S,
)
NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?")
ANYTHING = "..."
RELATIVE, SMALL, FINE = 0.05, 0.2, 0.002
FINE_DECIMALS = 4


@dataclass(frozen=True)
class Example:
    """page: file; line: of the block in it; world: what must be there; printed: expected on stdout, None for any."""

    page: Path
    line: int
    world: str
    language: str
    code: str
    printed: str | None


def examples_in(page: Path) -> Iterator[Example]:
    """The examples of one page, in their order."""
    text = page.read_text(encoding="utf-8")
    for found in BLOCK.finditer(text):
        line = text.count("\n", 0, found.start()) + 1
        yield Example(page, line, found["world"], found["language"], found["code"], found["printed"])


def fault_of(example: Example, folder: Path, environment: dict[str, str], names: dict[str, object]) -> str | None:
    """Run an example in `folder` and say what is wrong with it, None for nothing.

    environment: of commands. names: the namespace of the page's Python, whose working folder the caller sets.
    """
    if example.language == "python":
        printed = io.StringIO()
        place = f"{example.page.name}, line {example.line}"
        with contextlib.redirect_stdout(printed):
            exec(compile(example.code, place, "exec"), names)
        return compared(printed.getvalue(), example.printed)
    for command, expected in commands_of(example):
        done = subprocess.run(
            command, shell=True, cwd=folder, env=environment, capture_output=True, text=True, check=False
        )
        if done.returncode != 0:
            return f"{command}: exit status {done.returncode}\n{done.stderr}"
        if fault := compared(done.stdout, expected):
            return f"{command}: {fault}"
    return None


def commands_of(example: Example) -> Iterator[tuple[str, str | None]]:
    """Commands with what they print; None where that is not shown."""
    if example.language == "console":
        for part in re.split(r"^\$ ", example.code, flags=re.M)[1:]:
            command, _, printed = part.partition("\n")
            yield command, printed or None
    else:
        for line in example.code.replace("\\\n", " ").splitlines():
            if line.strip() and not line.startswith("#"):
                yield line, None


def compared(printed: str, expected: str | None) -> str | None:
    """What differs between printed and expected text, None for nothing."""
    if expected is None:
        return None
    lines, wanted = printed.strip().splitlines(), expected.strip().splitlines()
    if wanted[-1:] == [ANYTHING]:
        lines, wanted = lines[: len(wanted) - 1], wanted[:-1]
    differing = [f"{a!r} instead of {b!r}" for a, b in zip(lines, wanted, strict=False) if not alike(a, b)]
    if len(lines) != len(wanted):
        differing.append(f"{len(lines)} lines instead of {len(wanted)}: {printed}")
    return "; ".join(differing) or None


def alike(printed: str, expected: str) -> bool:
    """Whether two lines have the same words, and numbers that differ by no more than other arithmetic or a
    small change of the method makes them: 5 %, 0.2, or 0.002 where four decimals are shown."""
    if ANYTHING in expected:
        parts = (NUMBER.sub("#", part) for part in expected.split(ANYTHING))
        return bool(re.fullmatch(".*".join(map(re.escape, parts)), NUMBER.sub("#", printed)))
    if NUMBER.sub("#", printed).split() != NUMBER.sub("#", expected).split():
        return False
    return all(near(a, b) for a, b in zip(NUMBER.findall(printed), NUMBER.findall(expected), strict=True))


def near(printed: str, expected: str) -> bool:
    """Whether two numbers, as printed, are as good as equal."""
    decimals = len(expected.partition(".")[2])
    allowed = FINE if decimals >= FINE_DECIMALS else max(RELATIVE * abs(float(expected)), SMALL)
    return abs(float(printed) - float(expected)) <= allowed
