"""The reference of the command line, made from the application itself."""

import re
from functools import cache

from typer.core import TyperCommand, TyperGroup
from typer.main import get_command

from building.markdown import block, code, table
from flows.cli import build_app

Command = TyperCommand | TyperGroup
PROGRAM = "planetpose"
OPTION = re.compile(r"(?<![\w`-])(--[a-z][a-z-]+)")


@cache
def application() -> TyperGroup:
    """The command `planetpose` with all that belong to it."""
    found = get_command(build_app())
    if not isinstance(found, TyperGroup):
        raise TypeError("the application is expected to be a group of commands")
    return found


def all_commands() -> dict[str, Command]:
    """Every command that does something, by its words: `catalog show`."""
    return dict(_leaves(application(), ()))


def _leaves(group: TyperGroup, words: tuple[str, ...]) -> list[tuple[str, Command]]:
    found: list[tuple[str, Command]] = []
    for name, command in sorted(group.commands.items()):
        if command.hidden:
            continue
        if isinstance(command, TyperGroup):
            found += _leaves(command, (*words, name))
        else:
            found.append((" ".join((*words, name)), command))
    return found


def page(_: str = "") -> str:
    """A section for every command: what it does, its arguments and options."""
    return "\n".join(section(words, command) for words, command in all_commands().items())


def section(words: str, command: Command) -> str:
    """One command."""
    context = command.make_context(words, [], resilient_parsing=True)
    usage = " ".join(command.collect_usage_pieces(context))
    parts = [f"## `{PROGRAM} {words}`\n", f"{(command.help or '').strip()}\n", block(f"{PROGRAM} {words} {usage}")]
    rows = []
    for parameter in command.params:
        record = parameter.get_help_record(context)
        if parameter.name == "help" or record is None:
            continue
        rows.append((code(record[0].strip()), OPTION.sub(r"`\1`", record[1])))
    return "\n".join([*parts, table(("argument or option", "meaning"), rows) if rows else ""])
