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
    """Add planes that cubes do not contain, in planes.zarr beside the cube: azimuths, local time, sky, limb
    distance, parts of the uncertainty."""
    import sys
    from functools import partial

    from catalog.errors import RefusedError
    from catalog.plain_text import printable
    from flows.cli.output import clean_stdout, write_json
    from tasks.boundary import reason_of, trouble_of
    from tasks.project.more_planes import ADDED_PLANES, planes_named
    from tasks.publish.check import products_in
    from tasks.publish.extra_planes import EXTRA, write_extra_planes

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
    broken = 0
    with clean_stdout() as answer:
        for folder in [product for path in paths or () for product in products_in(path)]:
            trouble = trouble_of(partial(write_extra_planes, folder, names), folder.name)
            product, reason = printable(folder.name), reason_of(trouble) if trouble else None
            broken += reason is not None
            if json:
                path = None if reason else str(folder / EXTRA)
                content = {"product": product, "planes": [] if reason else list(names), "path": path, "reason": reason}
                write_json(answer, content)
            else:
                print(f"{product}: {reason}" if reason else folder / EXTRA, file=answer, flush=True)
    if broken:
        sys.exit(1)
