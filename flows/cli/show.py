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
        bool, typer.Option("--limb", help="Pictures of the limb: segments, profiles, derivatives, shifts.")
    ] = False,
    residual: Annotated[
        bool, typer.Option("--residual", help="Image, simulation and their difference, before and after.")
    ] = False,
    planes: Annotated[bool, typer.Option("--planes", help="Planes and flags of the cube.")] = False,
    all_: Annotated[bool, typer.Option("--all", help="All of them, and the overlay.")] = False,
    map: Annotated[
        Path | None,
        typer.Option(help="For --limb and --residual: base map of the product, if it is not the catalog's."),
    ] = None,
    open_: Annotated[bool, typer.Option("--open/--no-open", help="Open the picture where there is a display.")] = True,
) -> None:
    """Draw pictures of a product anew and print their paths; without options the overlay: image, predicted and
    corrected limb, grid, terminator."""
    from tasks.pictures.redraw import draw_limb, draw_planes, draw_residual
    from tasks.publish import redraw_overlay

    first: Path | None = None
    drawers = {
        "overlay": (all_ or not (limb or residual or planes), lambda: [redraw_overlay(path)]),
        "planes": (all_ or planes, lambda: [draw_planes(path)]),
        "residual": (all_ or residual, lambda: [draw_residual(path, map)]),
        "limb": (all_ or limb, lambda: draw_limb(path, map)),
    }
    for wanted, draw in drawers.values():
        for picture in draw() if wanted else ():
            first = first or picture
            print(picture, flush=True)
    if open_ and first and on_a_desk():
        typer.launch(str(first))


def on_a_desk() -> bool:
    """Whether somebody sits at a terminal with a display."""
    import os
    import sys

    has_display = sys.platform in ("darwin", "win32") or "DISPLAY" in os.environ or "WAYLAND_DISPLAY" in os.environ
    return sys.stdout.isatty() and has_display
