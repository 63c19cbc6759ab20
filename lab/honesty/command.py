"""planetpose benchmark honesty"""

from pathlib import Path
from typing import Annotated, Any

import typer

from catalog.settings import DEFAULT_PROFILE


def honesty(
    out: Annotated[Path, typer.Option(help="Folder for rows, figures and tables.")] = Path("out/honesty"),
    scenes: Annotated[int | None, typer.Option(min=1, help="Approximate number of scenes, over all kinds.")] = None,
    group: Annotated[list[str] | None, typer.Option(help="This group of scenes; repeat for more.")] = None,
    only: Annotated[list[str] | None, typer.Option(help="This scene; repeat for more.")] = None,
    draw: Annotated[
        int,
        typer.Option(min=0, max=1000, help="Number of the draw; another number makes other scenes of the same groups."),
    ] = 0,
    profile: Annotated[str, typer.Option(help="Name, or FILE.toml.")] = DEFAULT_PROFILE,
    workers: Annotated[int, typer.Option(min=1, help="Scenes at a time, each in its own process.")] = 2,
    minutes: Annotated[float | None, typer.Option(min=0, help="Minutes after which no further scene is begun.")] = None,
    keep: Annotated[bool, typer.Option("--keep", help="Keep the scenes' files and products.")] = False,
    json: Annotated[bool, typer.Option("--json", help="The figures as one JSON object on stdout.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress on stderr.")] = False,
) -> None:
    """Render scenes with known truth by an independent ray caster, correct them, and test every `ok` and stated error.

    Exit status 1 when an `ok` is wrong. A scene that was done with the same code and settings is not done again.
    """
    import sys
    from json import dumps

    from flows.cli.correct import usable_profile
    from flows.cli.output import clean_stdout, log_to_stderr, write_json
    from lab.honesty.report import summary
    from lab.honesty.run import chosen_scenes, run_scenes
    from lab.honesty.table import GROUPS, all_scenes
    from lab.honesty.tables import markdown

    known = {scene.id for scene in all_scenes()}
    for name, names, where in ((group, GROUPS, "--group"), (only, known, "--only")):
        if unknown := sorted(set(name or ()) - set(names)):
            listed = ", ".join(GROUPS) if where == "--group" else "GROUP-NNN, as small-003"
            raise typer.BadParameter(f"{', '.join(unknown)} is unknown; known are {listed}.", param_hint=where)

    def tell(row: dict[str, Any]) -> None:
        if not quiet:
            print(one_line(row), file=sys.stderr, flush=True)

    log_to_stderr()
    with clean_stdout() as answer:
        chosen = chosen_scenes(scenes, group or (), only or (), draw)
        rows = run_scenes(chosen, usable_profile(profile, None), out, workers, minutes, keep, tell)
        figures = summary(rows)
        (out / "honesty.json").write_text(dumps(figures, indent=1, allow_nan=False) + "\n", encoding="utf-8")
        (out / "honesty.md").write_text(markdown(figures), encoding="utf-8")
        if json:
            write_json(answer, figures)
        else:
            print(markdown(figures), file=answer)
    raise typer.Exit(1 if figures["violations"] else 0)


def one_line(row: dict[str, Any]) -> str:
    """A scene as soon as it is done."""
    from lab.honesty.assess import assess, violations

    errors, result = assess(row), row["result"]
    seconds = f"{row['cpu_s']['render']:.1f} + {row['cpu_s']['correct']:.1f} s"
    if errors is None:
        return f"{row['id']}: {result['status']}: {(result['reason'] or '')[:100]}; {seconds}"
    wrong = ", ".join(entry["kind"] for entry in violations(row, errors))
    return (
        f"{row['id']}: {result['status']}: centre {errors['centre_px']['size']:.3f} px, limb "
        f"{errors['range']['limb_px']:+.3f} px, subpoint {errors['subpoint_deg']['size']:.2f} deg, roll "
        f"{errors['roll_deg']['error'][0]:+.2f} deg; {seconds}{f'; WRONG: {wrong}' if wrong else ''}"
    )
