"""planetpose kernels PATH... --out DIR"""

from pathlib import Path
from typing import Annotated

import typer


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(kernels)


def kernels(
    paths: Annotated[list[Path], typer.Argument(help="Products' folders, or stores.", show_default=False)],
    out: Annotated[Path, typer.Option(help="Folder that the sets are written in, a folder each.")] = Path("kernels"),
    kernels: Annotated[
        list[Path] | None, typer.Option(help="The mission's kernels: files, meta-kernels or folders; repeat for more.")
    ] = None,
    no_kernels: Annotated[bool, typer.Option("--no-kernels", help="Use no kernels, not even default ones.")] = False,
    per_image: Annotated[bool, typer.Option("--per-image", help="A set per image instead of one per mission.")] = False,
    check: Annotated[
        bool, typer.Option("--check/--no-check", help="Compare with plain SPICE in a second process.")
    ] = True,
    json: Annotated[bool, typer.Option("--json", help="One JSON object per set on stdout.")] = False,
) -> None:
    """Write corrected SPICE kernels: camera orientation, spacecraft position, target attitude, meta-kernels."""
    import sys

    from catalog.plain_text import printable
    from catalog.settings import default_kernels
    from flows.cli.correct import usable_kernels
    from flows.cli.output import clean_stdout, write_json
    from flows.kernels import kernels_of

    usable_kernels(kernels or [])
    given = [] if no_kernels else list(kernels) if kernels else default_kernels()
    damaged: list[Path] = []

    def refused(product: Path, reason: str) -> None:
        damaged.append(product)
        print(f"{printable(product.name)}: left out: {reason}", file=sys.stderr)

    with clean_stdout() as answer:
        for kernel_set in kernels_of(paths, out, given, per_image, check, refused):
            if json:
                write_json(answer, kernel_set)
                continue
            for kind, path in kernel_set["meta_kernels"].items():
                trip = (kernel_set["round_trip_deg"] or {}).get(kind)
                agrees = f"; plain SPICE agrees to {max(trip.values()):.1e} deg" if trip else ""
                print(f"{path}: {len(kernel_set['products'])} images, {kind}{agrees}", file=answer)
            for note in kernel_set["left_out"]:
                print(f"  {note['product']}: no {note['what']}: {note['why']}", file=answer)
    sys.exit(1 if damaged else 0)
