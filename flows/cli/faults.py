"""planetpose benchmark faults"""

import sys
from pathlib import Path
from typing import Annotated, Any

import typer


def faults(
    images: Annotated[int, typer.Option(min=1, help="Small images in the list.")] = 6,
    kills: Annotated[int, typer.Option(min=0, help="kill -9 at so many random moments.")] = 20,
    seed: Annotated[int, typer.Option(min=0, help="Another seed: other moments.")] = 1,
    only: Annotated[list[str] | None, typer.Option(help="Only this scenario; repeat for more.")] = None,
    folder: Annotated[Path | None, typer.Option(help="Where to work; kept. Default: a temporary folder.")] = None,
    json: Annotated[bool, typer.Option("--json", help="One JSON object per scenario on stdout.")] = False,
) -> None:
    """Kill, fill, hang and double reprocessing runs; after a rerun every cube must be there and right."""
    from tempfile import TemporaryDirectory

    from flows.cli.output import clean_stdout, write_json
    from flows.faults.bench import benchmark_faults, line_of

    def tell(row: dict[str, Any]) -> None:
        if json:
            write_json(answer, row)
        else:
            print(line_of(row), file=answer, flush=True)

    with clean_stdout() as answer, TemporaryDirectory() as temporary:
        rows = benchmark_faults(folder or Path(temporary), images, kills, seed, tuple(only or ()), tell)
        good = sum(row["good"] for row in rows)
        print(f"{good} of {len(rows)} scenarios ended with every image right", file=sys.stderr)
    raise typer.Exit(0 if good == len(rows) else 1)
