"""planetpose show PATH"""

from pathlib import Path
from typing import Annotated

import typer


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(show)


def show(
    path: Annotated[Path, typer.Argument(help="A product folder, as written by `planetpose correct`.")],
    open_: Annotated[bool, typer.Option("--open/--no-open", help="Open the picture where there is a display.")] = True,
) -> None:
    """Draw the overlay picture anew and print its path: image, predicted and corrected limb, grid, terminator."""
    from tasks.publish import redraw_overlay

    picture = redraw_overlay(path)
    print(picture)
    if open_ and on_a_desk():
        typer.launch(str(picture))


def on_a_desk() -> bool:
    """Whether somebody sits at a terminal with a display."""
    import os
    import sys

    has_display = sys.platform in ("darwin", "win32") or "DISPLAY" in os.environ or "WAYLAND_DISPLAY" in os.environ
    return sys.stdout.isatty() and has_display
