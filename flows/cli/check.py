"""planetpose check PATH..."""

from pathlib import Path
from typing import Annotated

import typer


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(check)


def check(
    paths: Annotated[list[Path], typer.Argument(help="Stores, or products' folders.", show_default=False)],
    json: Annotated[bool, typer.Option("--json", help="One JSON object per product on stdout.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Only products with faults.")] = False,
) -> None:
    """Check published products: checksums, schema, values, provenance, and geometry against their own pose."""
    import sys

    from flows.cli.output import clean_stdout, write_json
    from tasks.publish.check import product_faults, products_in

    sound, count = 0, 0
    with clean_stdout() as answer:
        for folder in [product for path in paths for product in products_in(path)]:
            faults = product_faults(folder)
            count, sound = count + 1, sound + (not faults)
            if json:
                named = [{"kind": fault.kind, "fault": fault.text} for fault in faults]
                write_json(answer, {"product": folder.name, "path": str(folder), "sound": not faults, "faults": named})
                continue
            for fault in faults:
                print(f"{folder}: {fault}", file=answer)
            if not faults and not quiet:
                print(f"{folder}: sound", file=answer, flush=True)
        if not json:
            print(f"{sound} of {count} products sound", file=answer)
    sys.exit(0 if sound == count else 1)
