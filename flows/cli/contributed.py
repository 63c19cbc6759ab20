"""Commands that other packages add: entry points of the group `planetpose.commands`, each a function `register(app)`.

The name of the entry point is the command's. What is heavy belongs inside the command's function, as here.
"""

import sys
from collections.abc import Callable
from importlib.metadata import EntryPoint, entry_points

import typer

GROUP = "planetpose.commands"


def add_contributed(app: typer.Typer, known: set[str]) -> None:
    """Add every contributed command that is not among `known` names. One that cannot be loaded is there all the same,
    and says what is missing when it is used."""
    for entry in sorted(entry_points(group=GROUP), key=lambda found: found.name):
        if entry.name in known:
            print(f"planetpose: {entry.value} adds no command: {entry.name!r} is taken.", file=sys.stderr)
            continue
        known.add(entry.name)
        try:
            register = entry.load()
        except (ImportError, AttributeError, SyntaxError) as error:
            anything = {"allow_extra_args": True, "ignore_unknown_options": True, "help_option_names": []}
            app.command(entry.name, context_settings=anything, help=f"Not usable: {error}.")(refusing(entry, error))
        else:
            register(app)


def refusing(entry: EntryPoint, error: Exception) -> Callable[[], None]:
    """A command that does nothing but raise RefusedError, with what to install."""

    def refuse() -> None:
        from catalog.errors import RefusedError

        raise RefusedError("command-unusable", f"`planetpose {entry.name}` cannot be loaded ({error}).", remedy(entry))

    return refuse


def remedy(entry: EntryPoint) -> str:
    """What to install: the extra that is called like the command's package where its distribution has one, else the
    distribution again."""
    if entry.dist is None:
        return f"Install what {entry.module} needs."
    package, distribution = entry.module.partition(".")[0], entry.dist.name
    extra = f"[{package}]" if package in (entry.dist.metadata.get_all("Provides-Extra") or ()) else ""
    return f"Install it with what it needs: pip install '{distribution}{extra}'."
