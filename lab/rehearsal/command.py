"""planetpose benchmark deploy|throughput"""

from typing import Annotated

import typer


def deploy(
    images: Annotated[int, typer.Option(min=2, help="Small simulated images in the list.")] = 6,
    json: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
) -> None:
    """Rehearse a deployment: a server on a private PostgreSQL behind a password, a process worker, the deployments of
    deploy/prefect.yaml; then a schedule fires, the database restarts, server and worker are killed in mid-run. Some
    minutes."""
    import sys

    from flows.cli.output import clean_stdout, write_json
    from lab.rehearsal.postgres import PostgresError
    from lab.rehearsal.scenarios import rehearse

    with clean_stdout() as answer:
        try:
            found = rehearse(images, lambda line: print(line, file=sys.stderr, flush=True))
        except PostgresError as error:
            raise typer.BadParameter(str(error)) from error
        if json:
            write_json(answer, found)
        else:
            for name, figures in found.items():
                reported = ", ".join(f"{key} {value}" for key, value in figures.items())
                print(f"{name:20s} {reported}", file=answer)
    raise typer.Exit(0 if all(figures["good"] for figures in found.values()) else 1)


def throughput(
    images: Annotated[int, typer.Option(min=2, help="Small simulated images in the list.")] = 24,
    workers: Annotated[list[int] | None, typer.Option(min=1, help="Processes; repeat (default: 1 and 2).")] = None,
    json: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
) -> None:
    """Images per second on a Dask cluster of this machine, with one and with two worker processes."""
    import sys

    from flows.cli.output import clean_stdout, write_json
    from lab.rehearsal.throughput import measure_throughput

    with clean_stdout() as answer:
        found = measure_throughput(images, workers or [1, 2], lambda line: print(line, file=sys.stderr, flush=True))
        if json:
            write_json(answer, found)
        else:
            for run in found["runs"]:
                print("{workers} workers: {wall_s:.1f} s, {images_per_s:.3f} images per s".format(**run), file=answer)
            print(f"gain {found['gain']:.2f}", file=answer)
