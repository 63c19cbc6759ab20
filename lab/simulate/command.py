"""planetpose simulate CATALOG --seed N --out DIR"""

from pathlib import Path
from typing import Annotated

import typer


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(simulate)


def simulate(
    catalog: Annotated[str, typer.Argument(help="What to simulate: europa57.")],
    out: Annotated[Path, typer.Option(help="Folder for the files.")],
    seed: Annotated[int, typer.Option(min=0, help="Seed of the errors, surfaces and noise.")] = 1,
    only: Annotated[list[str] | None, typer.Option(help="This product; repeat for more.")] = None,
    camera: Annotated[list[str] | None, typer.Option(help="This camera; repeat for more.")] = None,
    limit: Annotated[int | None, typer.Option(min=1, help="Largest number of images.")] = None,
    matched: Annotated[
        bool, typer.Option("--matched", help="Surface, map, PSF and distortion are those that the corrections assume.")
    ] = False,
    map: Annotated[Path | None, typer.Option(help="Map of the true surface.")] = None,
    map_left_edge_deg: Annotated[float, typer.Option(help="East longitude of that map's left edge.")] = 0.0,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress on stderr.")] = False,
) -> None:
    """Simulate images of a catalog as raw files with planted errors, and write the truth beside them."""
    import sys
    import time

    from catalog.basemap import read_map
    from lab.simulate.archive import EUROPA57, MANIFEST, simulate_europa57
    from lab.simulate.synthesis import Synthetic

    if catalog != EUROPA57:
        raise typer.BadParameter(f"{catalog!r} is unknown; known: {EUROPA57}", param_hint="CATALOG")
    started = time.monotonic()

    def tell(made: Synthetic) -> None:
        if not quiet:
            geometry, surface = made.facts["geometry"], made.facts["surface"]
            line = f"{made.image.product}: {geometry['diameter_px']:.0f} px, phase {geometry['phase_deg']:.0f} deg"
            print(f"{line}, {surface['law']}, {surface['map']}", file=sys.stderr, flush=True)

    truth_map = read_map(map, map_left_edge_deg) if map else None
    files = simulate_europa57(out, seed, only or (), camera or (), limit, matched, truth_map, tell)
    print(f"{len(files)} images in {time.monotonic() - started:.0f} s: {out / MANIFEST}")
