"""planetpose benchmark faults, reprocess"""

import sys
from pathlib import Path
from typing import Annotated, Any

import typer


def faults(
    images: Annotated[int, typer.Option(min=1, help="Small images in the list.")] = 6,
    kills: Annotated[int, typer.Option(min=0, help="Number of random moments at which processes are killed.")] = 20,
    seed: Annotated[int, typer.Option(min=0, help="Another seed: other moments.")] = 1,
    only: Annotated[list[str] | None, typer.Option(help="Only this scenario; repeat for more.")] = None,
    folder: Annotated[Path | None, typer.Option(help="Where to work; kept. Default: a temporary folder.")] = None,
    json: Annotated[bool, typer.Option("--json", help="One JSON object per scenario on stdout.")] = False,
) -> None:
    """Kill, fill, hang and double reprocessing runs; after a rerun every cube must be there and right."""
    from tempfile import TemporaryDirectory

    from flows.cli.output import clean_stdout, write_json
    from lab.faults.bench import benchmark_faults, line_of

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


def reprocess(
    images: Annotated[
        Path | None,
        typer.Option(help="Image list. Default: the 57 images of `planetpose simulate europa57`, made anew."),
    ] = None,
    profile: Annotated[str, typer.Option(help="Methods and settings of the steps: a name, or FILE.toml.")] = "standard",
    workers: Annotated[int, typer.Option(min=1, help="Images at a time.")] = 2,
    small: Annotated[int, typer.Option(min=0, help="Small images; 0: leave them out.")] = 2000,
    archive: Annotated[
        bool, typer.Option("--archive/--no-archive", help="The image list; or small images only.")
    ] = True,
    folder: Annotated[Path | None, typer.Option(help="Where to work; kept. Default: a temporary folder.")] = None,
    json: Annotated[bool, typer.Option("--json", help="One JSON object per part on stdout.")] = False,
) -> None:
    """Time reprocessing of an archive: cold, unchanged, a late setting changed; and of very many small images."""
    from tempfile import TemporaryDirectory

    from flows.cli.output import clean_stdout, write_json
    from lab.benchmark.reprocess import benchmark_archive, benchmark_small
    from lab.simulate.archive import MANIFEST, simulate_europa57
    from local_server.server import ServerFiles, end

    def tell(part: str, figures: dict[str, Any]) -> None:
        if json:
            write_json(answer, {"part": part, **figures})
            return
        for name, value in figures.items():
            print(f"{part:18s} {name:22s} {value}", file=answer, flush=True)

    with clean_stdout() as answer, TemporaryDirectory() as temporary:
        place = folder or Path(temporary)
        try:
            if archive:
                if images is None:
                    simulate_europa57(place / "europa57", seed=1)
                benchmark_archive(images or place / "europa57" / MANIFEST, profile, workers, place / "archive", tell)
            if small:
                benchmark_small(small, workers, place / "small", tell)
        finally:
            for part in ("archive", "small"):
                end(ServerFiles(place / part / "state" / "server"))
