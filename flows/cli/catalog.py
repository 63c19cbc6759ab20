"""planetpose cameras, camera, targets, profiles: what the catalog knows."""

from pathlib import Path
from typing import Annotated

import typer

AsJson = Annotated[bool, typer.Option("--json", help="As one JSON object.")]


def register(app: typer.Typer) -> None:
    """Add the commands."""
    app.command()(cameras)
    app.command()(camera)
    app.command()(targets)
    app.command()(profiles)


def cameras(json: AsJson = False) -> None:
    """List the known cameras."""
    from catalog.camera import known_cameras

    known = known_cameras()
    if json:
        _print_json({name: camera.model_dump(mode="json") for name, camera in known.items()})
        return
    for name, camera in known.items():
        nx, ny = camera.size_px
        print(
            f"{name:20s} {nx}x{ny}  f = {camera.focal_length_px:.1f} px  {camera.distortion.model:12s} {camera.title}"
        )


def camera(
    name: Annotated[str, typer.Argument(help="Name, FILE.toml, kernels:NAME, isd:FILE or isis:FILE.")],
    kernels: Annotated[
        list[Path] | None, typer.Option(help="Kernels that describe the instrument: files, meta-kernels or folders.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Write the camera as this TOML file.")] = None,
    filter_name: Annotated[str | None, typer.Option("--filter", help="Filter, as in labels (CL1/GRN).")] = None,
    temperature: Annotated[float | None, typer.Option(help="Temperature of the focal plane, degrees Celsius.")] = None,
) -> None:
    """Show one camera as a camera file (TOML) with its sources, or write it."""
    from catalog.camera_store import camera_of, write_camera

    made = camera_of(name, kernels or None, filter_name, temperature)
    if out is None:
        print(made.to_toml(), end="")
        return
    write_camera(made, out)
    print(f"{out}: {made.name}, {made.size_px[0]}x{made.size_px[1]} px, f = {made.focal_length_px:.3f} px")


def targets(json: AsJson = False) -> None:
    """List the known targets; any body of a loaded PCK can be used too."""
    from catalog.target import further_targets, known_targets

    known = known_targets() | further_targets()
    if json:
        _print_json({name: target.model_dump(mode="json") for name, target in known.items()})
        return
    for name, target in known.items():
        radii = " x ".join(f"{radius:g}" for radius in target.radii_km)
        print(f"{name:12s} {target.naif_id:5d}  {radii:28s} km  map: {target.basemap or 'none'}")


def profiles(json: AsJson = False) -> None:
    """List the profiles with all their settings."""
    import json as json_module

    from tasks.profile import find_profile, known_profiles

    resolved = {name: find_profile(name).resolved() for name in known_profiles()}
    if json:
        _print_json(resolved)
        return
    for settings in resolved.values():
        print(json_module.dumps(settings, indent=1))


def _print_json(content: object) -> None:
    import json

    print(json.dumps(content))
