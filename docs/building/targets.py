"""What the target files say, as a table, and the further planes that cubes may have."""

from building.markdown import code
from building.markdown import table as table_of
from catalog.target import Target, further_targets, known_targets
from tasks.project.more_planes import ADDED_PLANES


def table(_: str = "") -> str:
    """All targets."""
    head = ("target", "NAIF", "radii, km", "how well known", "base map", "coordinates")
    return table_of(head, (row(target) for target in known_targets().values()))


def further(_: str = "") -> str:
    """Bodies without a base map."""
    bodies = sorted(further_targets().values(), key=lambda body: body.naif_id)
    rows = []
    for body in bodies:
        radii = ", ".join(f"{radius:g}" for radius in body.radii_km)
        rows.append((code(body.name), body.naif_id, radii, "yes" if body.rotation else "no"))
    return table_of(("target", "NAIF", "radii, km", "rotation model"), rows)


def row(target: Target) -> tuple[object, ...]:
    """One target."""
    radii = ", ".join(f"{radius:g}" for radius in target.radii_km)
    said = target.model_dump()
    known = {"1-sigma of the radius": said.get("radius_sigma_km"), "relief": said.get("relief_km")}
    described = ", ".join(f"{name} {value:g} km" for name, value in known.items() if value is not None)
    return (code(target.name), target.naif_id, radii, described, target.basemap or "none", code(target.iau_crs or ""))


def planes(_: str = "") -> str:
    """The planes of `planetpose planes`."""
    return table_of(("plane", "unit", "what"), ((code(p.name), p.units, p.long_name) for p in ADDED_PLANES.values()))
