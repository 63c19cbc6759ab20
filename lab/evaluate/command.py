"""planetpose evaluate DIR"""

from pathlib import Path
from typing import Annotated, Any

import typer

from catalog.settings import DEFAULT_PROFILE


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(evaluate)


def evaluate(
    folder: Annotated[Path, typer.Argument(help="Folder that `planetpose simulate` wrote.", show_default=False)],
    profile: Annotated[list[str] | None, typer.Option(help="Name or FILE.toml; repeat to compare several.")] = None,
    ablation: Annotated[
        bool, typer.Option("--ablation", help="Profiles paper and joint, and joint without each of its parts in turn.")
    ] = False,
    out: Annotated[Path, typer.Option(help="Folder for products, tables and reliability diagrams.")] = Path(
        "out/evaluate"
    ),
    json: Annotated[bool, typer.Option("--json", help="One JSON object on stdout: images and summary.")] = False,
    pose: Annotated[
        str | None, typer.Option(help="image: ignore the predicted poses, and find the poses in the images.")
    ] = None,
    only: Annotated[list[str] | None, typer.Option(help="This product; repeat for more.")] = None,
    camera: Annotated[list[str] | None, typer.Option(help="This camera; repeat for more.")] = None,
    limit: Annotated[int | None, typer.Option(min=1, help="Largest number of images.")] = None,
    jobs: Annotated[int, typer.Option(min=1, help="Images at a time, each in its own process.")] = 1,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress on stderr.")] = False,
) -> None:
    """Correct a simulated archive, as `planetpose correct` would, and compare with the truth."""
    import sys
    from json import dumps

    from catalog.pose import IN_IMAGE
    from flows.cli.correct import usable_profile
    from flows.cli.output import clean_stdout, log_to_stderr, write_json
    from lab.evaluate.ablation import ablation as ablated
    from lab.evaluate.archive import evaluate_archive
    from lab.evaluate.reliability_figure import reliability_figure
    from lab.evaluate.summary import summary_of
    from lab.evaluate.table import evaluation_table, write_csv

    if pose not in (None, IN_IMAGE):
        raise typer.BadParameter(f"{pose!r} is not {IN_IMAGE}", param_hint="--pose")
    named = profile or ([] if ablation else [DEFAULT_PROFILE])
    profiles = [*(usable_profile(name, None, quiet) for name in named), *(ablated() if ablation else [])]
    if len({each.name for each in profiles}) < len(profiles):
        raise typer.BadParameter("two profiles have one name", param_hint="--profile")

    def tell(row: dict[str, Any]) -> None:
        if not quiet:
            print(one_line(row), file=sys.stderr, flush=True)

    log_to_stderr()
    out.mkdir(parents=True, exist_ok=True)
    with clean_stdout() as answer:
        rows = evaluate_archive(
            folder, profiles, out / "products", only or (), camera or (), limit, jobs, tell, pose is not None
        )
        summary = summary_of(rows)
        report = {"archive": str(folder), "summary": summary, "images": rows}
        (out / "evaluate.json").write_text(dumps(report, indent=1, allow_nan=False) + "\n")
        write_csv(out / "evaluate.csv", rows)
        for each in profiles:
            reliability_figure(rows, each.name).savefig(out / f"reliability-{each.name}.png", format="png")
        if json:
            write_json(answer, report)
        else:
            print(evaluation_table(summary, rows), file=answer)


def one_line(row: dict[str, Any]) -> str:
    """An image as soon as it is done."""
    after = row["after"]
    start, seconds = f"{row['profile']} {row['product']}: {row['status']}", sum(row["seconds"].values())
    if after is None:
        return f"{start}: {row['reason']}"
    return (
        f"{start}: centre {after['centre_error_px']:.3f} px, range {after['range_error']:+.5f}, attitude "
        f"{after['attitude_error_deg']:.3f} deg, surface {after['surface_px']:.3f} px; {seconds:.1f} s"
    )
