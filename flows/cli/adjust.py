"""planetpose adjust STORE"""

from pathlib import Path
from typing import Annotated

import typer


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(adjust)


def adjust(
    store: Annotated[Path, typer.Argument(help="Store of images that the joint step corrected.", show_default=False)],
    out: Annotated[Path | None, typer.Option(help="Folder for adjust.json and a pose file per image.")] = None,
    gap: Annotated[float, typer.Option(min=0.001, help="Longest pause within a sequence, seconds.")] = 300.0,
    json: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
) -> None:
    """Solve for what images share: constants of cameras, attitude and range bias of sequences."""
    import sys

    from flows.adjust import adjust_store
    from flows.cli.output import clean_stdout, write_json
    from tasks.adjust import AdjustSettings
    from tasks.adjust.measurement import NOT_JOINT
    from tasks.adjust.table import adjustment_table

    with clean_stdout() as answer:
        report = adjust_store(store, AdjustSettings(gap_s=gap), out)
        if json:
            write_json(answer, report)
        else:
            print(adjustment_table(report), file=answer)
    if any(not each["reason"].startswith(NOT_JOINT) for each in report["left_out"]):
        sys.exit(1)
