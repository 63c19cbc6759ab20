"""planetpose benchmark stars"""

from typing import Annotated

import typer


def stars(
    frames: Annotated[int, typer.Option(min=1, help="How many, over all cameras and kinds in turn.")] = 100,
    seed: Annotated[int, typer.Option(min=0, help="Of the frames.")] = 1,
    kind: Annotated[
        list[str] | None, typer.Option(help="stars, no stars, stars elsewhere or wrong cone; repeat for more.")
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="One JSON object per frame, then the figures.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress on stderr.")] = False,
) -> None:
    """Draw frames of stars, disks and detector faults by another renderer, identify them, and compare with the truth.

    Exit status 1 when a frame without stars of the catalog, or one searched in the wrong place, has a lock.
    """
    import sys

    from flows.cli.output import clean_stdout, write_json
    from lab.stars.run import KINDS, do, scenes, summary

    kinds = tuple(kind or KINDS)
    if unknown := [each for each in kinds if each not in KINDS]:
        raise typer.BadParameter(
            f"there is no {', '.join(unknown)}; known are {', '.join(KINDS)}.", param_hint="--kind"
        )
    results = []
    with clean_stdout() as answer:
        for number, scene in enumerate(scenes(frames, seed, kinds), 1):
            results.append(do(scene))
            if json:
                write_json(answer, results[-1])
            if not quiet:
                found = "a lock" if results[-1]["lock"] else "no lock"
                print(f"{number}/{frames} {scene.camera.name}, {scene.kind}: {found}", file=sys.stderr, flush=True)
        figures = summary(results)
        if json:
            write_json(answer, figures)
        else:
            for name, value in figures.items():
                print(f"{name:20s} {value}", file=answer)
    raise typer.Exit(1 if figures["false_locks"] else 0)
