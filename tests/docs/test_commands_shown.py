"""Every `planetpose ...` line in README and documentation is one that the program takes."""

import re
import shlex
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "docs"))

from building.commands import Command, application  # noqa: E402
from typer.core import TyperGroup  # noqa: E402

TOP = [ROOT / name for name in ("README.md", "CHANGELOG.md", "deploy/README.md")]
PAGES = [*TOP, *sorted((ROOT / "docs").rglob("*.md"))]
FENCE = re.compile(r"^```(\w*)\n(.*?)^```", re.M | re.S)
INLINE = re.compile(r"`(planetpose [^`]+)`")


def page_name(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


def lines_of(text: str) -> Iterator[str]:
    """Commands in the fenced blocks of a page, continued lines joined, prompts and comments taken off."""
    for language, block in FENCE.findall(text):
        if language in ("", "sh", "console"):
            for line in block.replace("\\\n", " ").splitlines():
                line = re.split(r"\s#\s", line.strip().removeprefix("$ "))[0]
                if line.startswith("planetpose "):
                    yield line


def find(words: list[str]) -> tuple[Command, list[str]]:
    """The command that words begin with, and the rest of the words."""
    command: Command = application()
    while isinstance(command, TyperGroup) and words and words[0] in command.commands:
        command, words = command.commands[words[0]], words[1:]
    return command, words


@pytest.mark.parametrize("page", [page for page in PAGES if "planetpose " in page.read_text()], ids=page_name)
def test_commands_in_blocks_are_accepted(page: Path) -> None:
    faults = []
    for line in lines_of(page.read_text(encoding="utf-8")):
        words = shlex.split(re.split(r" (?:\||>|&&|2>) ", line)[0])[1:]
        command, rest = find(words)
        if isinstance(command, TyperGroup):
            faults.append(f"{line}: no such command")
            continue
        try:
            if not {"--help", "-h"} & set(rest):
                command.make_context(line, list(rest))
        except Exception as error:  # of typer's own kinds
            if not str(error).endswith("does not exist."):  # the store of an example
                faults.append(f"{line}: {error}")
    assert faults == []


@pytest.mark.parametrize("page", [page for page in PAGES if "`planetpose " in page.read_text()], ids=page_name)
def test_commands_in_sentences_exist_with_their_options(page: Path) -> None:
    faults = []
    for text in INLINE.findall(page.read_text(encoding="utf-8")):
        words = re.split(r"[\s,;]+", text)[1:]
        if not re.fullmatch(r"[a-z][a-z-]*", words[0]):
            continue
        command, rest = find(words)
        options = {name for parameter in command.params for name in parameter.opts} | {"--help", "-h"}
        given = {word.split("=")[0] for word in rest if word.startswith("-")}
        unknown = given - options
        if unknown or (isinstance(command, TyperGroup) and command.name == "planetpose"):
            faults.append(f"{text}: {', '.join(unknown) or 'no such command'}")
    assert faults == []
