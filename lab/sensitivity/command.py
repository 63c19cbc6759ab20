"""planetpose sensitivity"""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from lab.sensitivity.run import Row

# Small disks of three laws, phases and lenses, with good and rough metadata.
SCENES = ("laws-032", "laws-104", "laws-140")
# One of each kind that a threshold guards against; those that decide nothing on the scenes above are tried on these.
KINDS = (
    "smeared-002", "wrong-map-002", "detector-002", "small-002", "no-map-004", "distorted-002", "cut-003", "relief-000",
    "wrong-shape-006", "recording-037", "shadows-002", "crescents-003",
)  # fmt: skip


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(sensitivity)


def sensitivity(
    out: Annotated[Path, typer.Option(help="The page that is written, Markdown.")] = Path("out/sensitivity.md"),
    scene: Annotated[
        list[str] | None, typer.Option(help="This scene of the honesty benchmark, and no other; repeat for more.")
    ] = None,
    only: Annotated[
        list[str] | None, typer.Option(help="This threshold (PART.NAME, as iteration.stale_px); repeat for more.")
    ] = None,
    profile: Annotated[str, typer.Option(help="Name, or FILE.toml, whose joint settings are tried.")] = "joint",
    minutes: Annotated[
        float | None, typer.Option(min=0, help="Minutes of each part after which no further threshold is begun.")
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress on stderr.")] = False,
) -> None:
    """Halve and double each threshold of the joint step on images with known truth; write what that does to errors and
    their calibration. First on small disks; then those that decide nothing there, on a scene of each kind of fault.
    One process, about three quarters of an hour."""
    import sys

    from catalog.errors import RefusedError
    from catalog.reasons import Reason
    from flows.cli.correct import usable_profile
    from lab.honesty.table import all_scenes
    from lab.sensitivity.cases import cases_of
    from lab.sensitivity.run import sensitivity as rows_of
    from lab.sensitivity.run import threshold_names
    from lab.sensitivity.table import idle, page

    for given, known in ((scene or [], {row.id for row in all_scenes()}), (only or [], set(threshold_names()))):
        if unknown := sorted(set(given) - known):
            near = ", ".join(sorted(known)[:3])
            raise RefusedError(Reason.PART_UNKNOWN, f"there is no {', '.join(unknown)}.", f"Known are {near}, ...")
    settings = usable_profile(profile, None).joint
    tell = (lambda _: None) if quiet else (lambda text: print(text, file=sys.stderr, flush=True))
    parts: list[tuple[str, list[Row], list[str]]] = []
    for title, scenes in (("Scenes given", scene),) if scene else (("Small disks", SCENES), ("Kinds of fault", KINDS)):
        names = idle(parts[-1][1]) if parts else only
        if names == []:
            break
        rows: list[Row] = []
        parts.append((title, rows, list(scenes)))
        for row in rows_of(cases_of(scenes), settings, minutes, tell, names):
            rows.append(row)
            out.parent.mkdir(parents=True, exist_ok=True)
            out.write_text(page(parts), encoding="utf-8")
    print(out)
