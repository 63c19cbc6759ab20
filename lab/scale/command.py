"""planetpose benchmark scale"""

from typing import Annotated, Any

import typer


def scale(
    images: Annotated[int, typer.Option(min=2, help="Small simulated images in the list.")] = 20,
    troubles: Annotated[
        int, typer.Option(min=0, help="Workers, schedulers, commands and connections that are lost.")
    ] = 20,
    costs: Annotated[bool, typer.Option("--costs", help="Measure costs per image instead, undisturbed.")] = False,
    machines: Annotated[int, typer.Option(min=1, help="With --costs: computed for so many machines.")] = 100,
    processors: Annotated[int, typer.Option(min=1, help="Of each of them.")] = 8,
    image_s: Annotated[float | None, typer.Option(min=0.01, help="Processor seconds of an image of yours.")] = None,
    seed: Annotated[int, typer.Option(help="Of the random moments.")] = 0,
    json: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
) -> None:
    """Many machines that share nothing but S3, on this one: an S3 server (moto), a Dask scheduler and two workers with
    folders of their own, of which something is lost again and again. Some minutes."""
    import sys

    from flows.cli.output import clean_stdout, write_json
    from lab.scale.projection import projected
    from lab.scale.run import disturb, measure_costs

    def tell(line: str) -> None:
        print(line, file=sys.stderr, flush=True)

    with clean_stdout() as answer:
        if costs:
            found = measure_costs(images, tell)
            found |= {"computed": projected(found, machines, processors, image_s)}
        else:
            found = disturb(images, troubles, seed, tell)
        if json:
            write_json(answer, found)
        else:
            print("\n".join(lines_of(found)), file=answer)
    bad = found["unsound"] + found["lost"] + found.get("published_twice", 0)
    raise typer.Exit(1 if bad else 0)


def lines_of(found: dict[str, Any], indent: str = "") -> list[str]:
    """For people."""
    lines: list[str] = []
    for name, value in found.items():
        table = isinstance(value, dict) and len(value) > 0
        lines.append(f"{indent}{name}:" if table else f"{indent}{name:34s} {value}")
        lines += lines_of(value, indent + "  ") if table else []
    return lines
