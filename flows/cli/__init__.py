"""The command line `planetpose`. A command is a module of this package that has `register(app)`; it imports what is
heavy inside its functions, so that `planetpose --help` and cached answers come at once. Other packages add commands by
entry points (`contributed`)."""

import os
import pkgutil
import sys
from importlib import import_module
from typing import Annotated

import typer
from typer.main import get_group

from flows.cli.contributed import add_contributed


def build_app(wanted: str | None = None) -> typer.Typer:
    """The application with every command of this package, and of those that contribute some unless `wanted`, the only
    one that will be used, is of this package."""
    app = typer.Typer(
        name="planetpose",
        help="Precise geometry of disk-resolved spacecraft images.",
        no_args_is_help=True,
        add_completion=False,
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    app.callback()(common)
    for module in sorted(pkgutil.iter_modules(__path__), key=lambda found: found.name):
        command = import_module(f"{__name__}.{module.name}")
        if hasattr(command, "register"):
            command.register(app)
    known = set(get_group(app).commands)
    if wanted not in known:
        add_contributed(app, known)
    return app


def say_version(wanted: bool) -> None:
    """Print name and version, and end."""
    if wanted:
        from importlib.metadata import version

        print(f"planetpose {version('planetpose')}")
        raise typer.Exit


Version = Annotated[bool, typer.Option("--version", callback=say_version, is_eager=True, help="Print the version.")]


def common(version: Version = False) -> None:
    """Precise geometry of disk-resolved spacecraft images."""


def main() -> None:
    """Entry point. Exit status: 0 all ok, 1 some image failed or was refused, 2 wrong usage."""
    from catalog.errors import PlanetposeError
    from catalog.loopback import keep_loopback_direct

    keep_loopback_direct(os.environ)
    try:
        build_app(next(iter(sys.argv[1:]), None))()
    except PlanetposeError as error:
        print(f"planetpose: {error.reason}", file=sys.stderr)
        sys.exit(1)
    except OSError as error:  # a full disk, a folder that may not be written in
        from tasks.boundary import file_trouble

        print(f"planetpose: {file_trouble(error)}", file=sys.stderr)
        sys.exit(1)
