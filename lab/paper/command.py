"""planetpose paper"""

from pathlib import Path
from typing import Annotated

import typer


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(paper)


def paper(
    out: Annotated[Path, typer.Option(help="Folder for index.html, paper.json and figures.")] = Path("out/paper"),
    only: Annotated[
        str | None,
        typer.Option(metavar="NAME[,NAME]", help="Only these parts; an unknown name prints the list of all parts."),
    ] = None,
    evaluation: Annotated[
        Path | None, typer.Option(exists=True, file_okay=False, help="Folder written by `planetpose evaluate`.")
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="paper.json as one line on stdout.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress on stderr.")] = False,
) -> None:
    """Repeat the paper's tables and figures in one report: its figure, ours, and the difference."""
    import sys
    from json import loads

    from flows.cli.output import clean_stdout, log_to_stderr, write_json
    from lab.paper.report import write_report

    log_to_stderr()
    with clean_stdout() as answer:
        report = write_report(
            out,
            usable_parts(only),
            evaluation,
            tell=lambda text: None if quiet else print(f"  {text}", file=sys.stderr, flush=True),
        )
        if json:
            write_json(answer, loads(report.json_file.read_text(encoding="utf-8")))
        else:
            for section in report.sections:
                if section.missing:
                    print(f"{section.name}: not made: {section.missing}", file=answer)
            print(report.page_file, file=answer)


def usable_parts(only: str | None) -> list[str] | None:
    """The names in `only`; an unknown one is wrong usage."""
    from catalog.errors import RefusedError
    from lab.paper.report import checked_names

    if only is None:
        return None
    try:
        return checked_names([name.strip() for name in only.split(",") if name.strip()])
    except RefusedError as error:
        raise typer.BadParameter(str(error), param_hint="--only") from error
