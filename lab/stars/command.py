"""planetpose benchmark stars | separation"""

from pathlib import Path
from typing import Annotated

import typer


def stars(
    frames: Annotated[int, typer.Option(min=1, help="Number of frames, over all cameras and kinds in turn.")] = 100,
    seed: Annotated[int, typer.Option(min=0, help="Of the frames.")] = 1,
    kind: Annotated[
        list[str] | None, typer.Option(help="stars, no stars, stars elsewhere or wrong cone; repeat for more.")
    ] = None,
    rows: Annotated[
        Path | None, typer.Option(help="File of a line of JSON per frame; frames that it has are not drawn again.")
    ] = None,
    minutes: Annotated[float | None, typer.Option(min=0, help="Minutes after which no further frame is begun.")] = None,
    json: Annotated[bool, typer.Option("--json", help="One JSON object per frame, then the figures.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress on stderr.")] = False,
) -> None:
    """Draw frames of stars, disks and detector faults by another renderer, identify them, and compare with the truth.

    Exit status 1 when a frame without stars of the catalog, or one searched in the wrong place, has a lock.
    """
    import sys

    from flows.cli.output import clean_stdout, write_json
    from lab.rows import rows_in_portions
    from lab.stars.run import KINDS, do, scenes, summary

    kinds = tuple(kind or KINDS)
    if unknown := [each for each in kinds if each not in KINDS]:
        raise typer.BadParameter(
            f"there is no {', '.join(unknown)}; known are {', '.join(KINDS)}.", param_hint="--kind"
        )
    results = []
    with clean_stdout() as answer:
        for row, new in rows_in_portions(
            scenes(frames, seed, kinds), lambda scene: f"{scene.kind} {scene.seed}", do, rows, minutes
        ):
            results.append(row)
            if json:
                write_json(answer, row)
            if new and not quiet:
                found = "a lock" if row["lock"] else "no lock"
                line = f"{len(results)}/{frames} {row['camera']}, {row['kind']}: {found}"
                print(line, file=sys.stderr, flush=True)
        figures = summary(results)
        if json:
            write_json(answer, figures)
        else:
            for name, value in figures.items():
                print(f"{name:20s} {value}", file=answer)
    raise typer.Exit(1 if figures["false_locks"] else 0)


def separation(
    scenes: Annotated[int, typer.Option(min=1, help="Number of frames, over all cameras in turn.")] = 48,
    seed: Annotated[int, typer.Option(min=0, help="Of the frames.")] = 7,
    rows: Annotated[
        Path | None, typer.Option(help="File of a line of JSON per frame; frames that it has are not done again.")
    ] = None,
    minutes: Annotated[float | None, typer.Option(min=0, help="Minutes after which no further frame is begun.")] = None,
    json: Annotated[bool, typer.Option("--json", help="One JSON object per frame, then the figures.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress on stderr.")] = False,
) -> None:
    """Correct frames of a body among stars, drawn by an independent ray caster, whose camera and whose target are off
    by planted amounts; both must come back apart, and plain SPICE must read them from the kernels.

    Exit status 1 when an `ok` is off by more than 0.1 px and 3 sigmas, or the kernels by more than 2e-5 deg.
    """
    import sys

    from flows.cli.output import clean_stdout, write_json
    from lab.rows import rows_in_portions
    from lab.stars.separation_run import BAR_KERNELS_DEG, cases, do, separation_summary

    results = []
    with clean_stdout() as answer:
        for row, new in rows_in_portions(cases(scenes, seed), lambda case: str(case.seed), do, rows, minutes):
            results.append(row)
            if json:
                write_json(answer, row)
            if new and not quiet:
                off = "no offset" if row["error_px"] is None else f"{row['error_px']:.3f} px off"
                print(f"{len(results)}/{scenes} {row['camera']}: {row['status']}, {off}", file=sys.stderr, flush=True)
        figures = separation_summary(results)
        if json:
            write_json(answer, figures)
        else:
            for name, value in figures.items():
                print(f"{name:20s} {value}", file=answer)
    bad = figures["wrong_ok"] or (figures["kernels_deg_worst"] or 0) > BAR_KERNELS_DEG
    raise typer.Exit(1 if bad else 0)
