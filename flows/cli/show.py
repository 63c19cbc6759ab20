"""planetpose show PATH"""

from pathlib import Path
from typing import Annotated

import typer


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(show)


def show(
    path: Annotated[Path, typer.Argument(help="A product folder, as written by `planetpose correct`.")],
    limb: Annotated[
        bool, typer.Option("--limb", help="Pictures of the limb instead: segments, profiles, derivatives, shifts.")
    ] = False,
    map: Annotated[
        Path | None,
        typer.Option(help="With --limb: the base map that the product was made with, if not the catalog's."),
    ] = None,
    open_: Annotated[bool, typer.Option("--open/--no-open", help="Open the picture where there is a display.")] = True,
) -> None:
    """Draw the overlay picture anew and print its path: image, predicted and corrected limb, grid, terminator."""
    pictures = limb_pictures(path, map) if limb else [overlay_picture(path)]
    for picture in pictures:
        print(picture)
    if open_ and on_a_desk():
        typer.launch(str(pictures[0]))


def overlay_picture(path: Path) -> Path:
    """Draw the overlay of a product anew."""
    from tasks.publish import redraw_overlay

    return redraw_overlay(path)


def limb_pictures(path: Path, basemap: Path | None) -> list[Path]:
    """Draw the lit limb of a product, image beside simulation, before and after the correction."""
    from tasks.pictures.redraw import draw_limb

    return draw_limb(path, basemap)


def on_a_desk() -> bool:
    """Whether somebody sits at a terminal with a display."""
    import os
    import sys

    has_display = sys.platform in ("darwin", "win32") or "DISPLAY" in os.environ or "WAYLAND_DISPLAY" in os.environ
    return sys.stdout.isatty() and has_display
