"""planetpose planes PATH..."""

from pathlib import Path
from typing import Annotated

import typer


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(planes)


def planes(
    paths: Annotated[
        list[Path] | None, typer.Argument(help="Products' folders, or stores.", show_default=False)
    ] = None,
    add: Annotated[str, typer.Option(help="all, or names separated by commas.")] = "all",
    list_: Annotated[bool, typer.Option("--list", help="Only print the names.")] = False,
    json: Annotated[bool, typer.Option("--json", help="One JSON object per product on stdout.")] = False,
) -> None:
    """Add planes that cubes do not hold, in planes.zarr beside the cube: azimuths, local time, sky, limb
    distance, parts of the uncertainty."""
    from catalog.errors import RefusedError
    from flows.cli.output import clean_stdout, write_json
    from tasks.project.more_planes import ADDED_PLANES, planes_named
    from tasks.publish.check import products_in
    from tasks.publish.extra_planes import write_extra_planes

    if list_:
        for name, plane in ADDED_PLANES.items():
            print(f"{name:28s} {plane.long_name} ({plane.units})")
        return
    if not paths:
        raise typer.BadParameter("give products or stores", param_hint="PATHS")
    try:
        names = planes_named(add)
    except RefusedError as error:
        raise typer.BadParameter(str(error), param_hint="--add") from error
    with clean_stdout() as answer:
        for folder in [product for path in paths or () for product in products_in(path)]:
            written = write_extra_planes(folder, names)
            if json:
                write_json(answer, {"product": folder.name, "planes": list(names), "path": str(written)})
            else:
                print(written, file=answer, flush=True)
