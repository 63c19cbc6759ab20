"""planetpose benchmark bodies"""

from pathlib import Path
from typing import Annotated

import typer


def bodies(
    json: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
    scenes: Annotated[int, typer.Option(min=1, max=2000, help="Number of scenes, over all kinds in turn.")] = 36,
    kind: Annotated[list[str] | None, typer.Option(help="Only this kind; repeat for more.")] = None,
    rows: Annotated[
        Path | None, typer.Option(help="File of a line of JSON per scene; scenes that it has are not done again.")
    ] = None,
    minutes: Annotated[float | None, typer.Option(min=0, help="Minutes after which no further scene is begun.")] = None,
) -> None:
    """Correct frames of several bodies: a moon beside its planet, before it, half hidden, in shadows, behind rings."""
    from flows.cli.output import clean_stdout, write_json
    from lab.bodies.run import numbered, run_scenes, summary_of
    from lab.bodies.scenes import KINDS

    unknown = sorted(set(kind or ()) - set(KINDS))
    if unknown:
        raise typer.BadParameter(f"{', '.join(unknown)}: known are {', '.join(KINDS)}.", param_hint="--kind")
    with clean_stdout() as answer:
        done = run_scenes(numbered(scenes, kind or ()), lambda row: typer.echo(line_of(row), err=True), rows, minutes)
        figures = summary_of(done)
        if json:
            write_json(answer, figures | {"rows": done})
        else:
            by_kind = figures.pop("by_kind")
            for name, value in figures.items():
                print(f"{name:28s} {value}", file=answer)
            for name, of_kind in by_kind.items():
                worst = of_kind["centre_worst_px"]
                line = f"{of_kind['ok']} of {of_kind['scenes']} ok"
                print(f"{name:28s} {line}{'' if worst is None else f', off by at most {worst:.3f} px'}", file=answer)


def line_of(row: dict[str, object]) -> str:
    """One scene's row in words."""
    error = row["centre_error_px"]
    off = f"{error:.3f} px off" if isinstance(error, float) else "no pose"
    return f"{row['id']:22s} {row['status']:9s} {off} {str(row['reason'] or '')[:100]}"
