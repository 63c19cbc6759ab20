"""planetpose benchmark NAME: what the program is measured by on this machine."""

from typing import Annotated

import typer

from lab.bodies.command import bodies
from lab.closeup.command import closeup
from lab.faults.command import faults, reprocess
from lab.fuzz.command import batches, fuzz
from lab.honesty.command import honesty
from lab.maps.command import control, improve_map, mosaic
from lab.page.command import page
from lab.rehearsal.command import deploy, throughput
from lab.scale.command import scale
from lab.stars.command import separation, stars


def register(app: typer.Typer) -> None:
    """Add the command group."""
    group = typer.Typer(help="Measurements of the program on this machine.", no_args_is_help=True)
    group.callback()(lambda: None)
    group.command()(projection)
    group.command()(mesh)
    group.command()(steps)
    group.command()(index)
    group.command()(growth)
    group.command()(fuzz)
    group.command()(batches)
    group.command()(honesty)
    group.command()(bodies)
    group.command()(closeup)
    group.command()(mosaic)
    group.command()(control)
    group.command("improve-map")(improve_map)
    group.command()(faults)
    group.command()(reprocess)
    group.command()(deploy)
    group.command()(throughput)
    group.command()(scale)
    group.command()(stars)
    group.command()(separation)
    group.command()(page)
    app.add_typer(group, name="benchmark")


def projection(
    json: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
    size: Annotated[int, typer.Option(min=16, max=8192, help="Frame of SIZE x SIZE pixels.")] = 1024,
    peers: Annotated[
        bool, typer.Option("--peers", help="Also rms-oops and PlanetMapper (pip install planetpose\\[lab]).")
    ] = False,
) -> None:
    """Time five planes of a frame against plain numpy and a SPICE loop, and compare the angles."""
    from flows.cli.output import clean_stdout, write_json
    from lab.benchmark.projection import benchmark_projection

    with clean_stdout() as answer:
        figures = benchmark_projection(size, peers)
        if json:
            write_json(answer, figures)
        else:
            for name, value in figures.items():
                print(f"{name:28s} {value}", file=answer)


def mesh(
    json: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
    size: Annotated[int, typer.Option(min=16, max=8192, help="Frame of SIZE x SIZE pixels.")] = 1024,
    facets: Annotated[int, typer.Option(min=100, max=10_000_000, help="About this many triangles.")] = 200_000,
) -> None:
    """Time five planes of a frame on a shape model, a sphere of triangles, and compare them with the sphere's."""
    from flows.cli.output import clean_stdout, write_json
    from lab.benchmark.mesh import benchmark_mesh

    with clean_stdout() as answer:
        figures = benchmark_mesh(size, facets)
        if json:
            write_json(answer, figures)
        else:
            for name, value in {**figures.pop("differences_deg"), **figures}.items():
                print(f"{name:28s} {value}", file=answer)


def steps(
    json: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
    profile: Annotated[str, typer.Option(help="Methods and settings of the steps: a name, or FILE.toml.")] = "paper",
    image: Annotated[
        str, typer.Option(help="disk-224 or disk-900 (px in 1024x1024), galileo or io (real, of PLANETPOSE_DATA).")
    ] = "disk-224",
    repeat: Annotated[int, typer.Option(min=1, max=100, help="Median of REPEAT runs after the first.")] = 1,
) -> None:
    """Time every step of a profile for one image on one core against its bar, and the flow of 1024x1024 frames."""
    from flows.cli.correct import usable_profile
    from flows.cli.output import clean_stdout, write_json
    from lab.benchmark.steps import IMAGES, benchmark_steps

    usable_profile(profile, None)
    if image not in IMAGES:
        raise typer.BadParameter(f"{image!r} is none of {', '.join(IMAGES)}.")
    with clean_stdout() as answer:
        figures = benchmark_steps(profile, image, repeat)
        if json:
            write_json(answer, figures)
        else:
            for name, value in {**figures.pop("steps_s"), **figures}.items():
                print(f"{name:28s} {value}", file=answer)


def index(
    json: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
    products: Annotated[int, typer.Option(min=2, max=100_000, help="Products in the store.")] = 1000,
) -> None:
    """Time a store's index: made from the cubes, opened, brought up to date after one change."""
    from flows.cli.output import clean_stdout, write_json
    from lab.benchmark.index import benchmark_index

    with clean_stdout() as answer:
        figures = benchmark_index(products)
        if json:
            write_json(answer, figures)
        else:
            for name, value in figures.items():
                print(f"{name:28s} {value}", file=answer)


def growth(
    json: Annotated[bool, typer.Option("--json", help="One JSON object per part on stdout.")] = False,
    products: Annotated[int, typer.Option(min=100, max=1_000_000, help="Products in a store.")] = 100_000,
    rows: Annotated[int, typer.Option(min=100, max=10_000_000, help="Rows of the index that is opened.")] = 1_000_000,
) -> None:
    """Measure how batches, index, status, plan and report grow with a store, in processor seconds and MB, by links of
    one product; exit status 1 when a bar is not kept."""
    from flows.cli.output import clean_stdout, write_json
    from lab.benchmark.growth import benchmark_growth, kept

    good = True
    with clean_stdout() as answer:

        def show(part: str, figures: dict[str, object]) -> None:
            nonlocal good
            good = good and kept(figures)
            if json:
                write_json(answer, {"part": part, **figures})
            else:
                print(
                    f"{part:8s} " + ", ".join(f"{name} {value}" for name, value in figures.items()),
                    file=answer,
                    flush=True,
                )

        benchmark_growth(products, rows, show)
    raise typer.Exit(0 if good else 1)
