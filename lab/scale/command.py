"""planetpose benchmark scale"""

from typing import Annotated

import typer


def scale(
    images: Annotated[int, typer.Option(min=2, help="Small simulated images in the list.")] = 20,
    troubles: Annotated[
        int, typer.Option(min=0, help="Workers, schedulers, commands and connections that are lost.")
    ] = 20,
    costs: Annotated[bool, typer.Option("--costs", help="Measure costs per image instead, undisturbed.")] = False,
    seed: Annotated[int, typer.Option(help="Of the random moments.")] = 0,
    json: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
) -> None:
    """Many machines that share nothing but S3, on this one: an S3 server (moto), a Dask scheduler and two workers with
    folders of their own, of which something is lost again and again. Some minutes."""
    import sys

    from flows.cli.output import clean_stdout, write_json
    from lab.scale.run import disturb, measure_costs

    def tell(line: str) -> None:
        print(line, file=sys.stderr, flush=True)

    with clean_stdout() as answer:
        found = measure_costs(images, tell) if costs else disturb(images, troubles, seed, tell)
        if json:
            write_json(answer, found)
        else:
            for name, value in found.items():
                print(f"{name:20s} {value}", file=answer)
    bad = found["unsound"] + found["lost"] + found.get("published_twice", 0)
    raise typer.Exit(1 if bad else 0)
