"""planetpose report STORE --out FOLDER"""

from pathlib import Path
from typing import Annotated

import typer


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(report)


def report(
    store: Annotated[Path, typer.Argument(help="A store.", exists=True, file_okay=False)],
    out: Annotated[Path, typer.Option(help="Folder for index.html, pages and pictures.")] = Path("out/report"),
    picture: Annotated[
        list[str] | None,
        typer.Option(help="overlay, residual, planes, limb; repeat for more. Default: the first three."),
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress on stderr.")] = False,
) -> None:
    """Write a store as static HTML: sortable table, distributions per camera, a page with pictures for every image."""
    import sys

    from flows.cli.output import clean_stdout, log_to_stderr
    from flows.report import write_report
    from tasks.report.pictures import KINDS, USUAL

    unknown = sorted(set(picture or ()) - set(KINDS))
    if unknown:
        raise typer.BadParameter(f"{', '.join(unknown)}; known are {', '.join(KINDS)}", param_hint="--picture")
    log_to_stderr()
    with clean_stdout() as answer:
        written = write_report(
            store,
            out,
            tuple(picture) if picture else USUAL,
            tell=lambda text: None if quiet else print(f"  {text}", file=sys.stderr, flush=True),
        )
        for name, why in written.missing.items():
            print(f"{name}: not drawn: {why}", file=sys.stderr)
        for name, why in written.broken.items():
            print(f"{name}: {why}", file=sys.stderr)
        print(written.page, file=answer)
    if written.missing or written.broken:
        sys.exit(1)
