"""What an ordinary scene is, and groups of scenes that try surfaces, sizes and geometries."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from lab.honesty.laws import LAWS
from lab.honesty.scene import Other

LENS_NAMES = ("lorri", "voyager", "galileo", "cassini")
MAPPED = ("europa", "io", "ganymede", "callisto", "mercury")
UNMAPPED = ("tethys", "mimas", "dione", "rhea", "iapetus", "triton")
PHASES = {"3-15": (3.0, 15.0), "25-60": (25.0, 60.0), "65-105": (65.0, 105.0), "110-130": (110.0, 130.0)}
RADII = {"8-25": (12.0, 25.0), "25-60": (28.0, 60.0), "60-150": (62.0, 140.0)}
Draw = np.random.Generator
Fields = dict[str, Any]
GROUPS: dict[str, Callable[[Draw], Iterator[Fields]]] = {}


def group(function: Callable[[Draw], Iterator[Fields]]) -> Callable[[Draw], Iterator[Fields]]:
    """Register a group of scenes by its function's name."""
    GROUPS[function.__name__.replace("_", "-")] = function
    return function


def usual(random: Draw, place: int, **fields: Any) -> Fields:
    """Fields of an ordinary scene, `place` of its group: lenses, bodies and laws take turns, phase, radius and
    how good the metadata are are drawn; what is given stays. Large disks get larger frames."""
    law = str(fields.pop("law", LAWS[(place * 5 + place // 6) % len(LAWS)]))
    radius = float(fields.pop("radius_px", random.uniform(45, 110)))
    lens = str(fields.pop("lens", LENS_NAMES[place % 4]))
    full = {"lorri": 1024, "cassini": 1024, "voyager": 1000, "galileo": 800}[lens]
    frame = full if radius > 150 or place % 7 == 3 else (512 if radius > 50 else 384)
    own: Fields = {
        "lens": lens,
        "frame_px": frame,
        "radius_px": radius,
        "phase_deg": random.uniform(20, 100),
        "law": law,
        "parameters": parameters_of(law, random),
        "target": MAPPED[(place + place // 4) % len(MAPPED)],
        "map_noise": random.uniform(0.02, 0.06),
        "map_contrast": random.uniform(0.8, 1.2),
        "psf_factor": random.uniform(0.85, 1.2),
        "wings": random.uniform(0.0, 0.08),
        "exposure": random.uniform(0.5, 0.9),
        "metadata": "good" if random.uniform() < 0.5 else "rough",
    }
    return own | fields


def parameters_of(law: str, random: Draw) -> dict[str, float]:
    """Parameters of a law, drawn from what solar-system surfaces show."""
    if law == "minnaert":
        return {"k": random.uniform(0.5, 0.9)}
    if law == "hapke":
        return {
            "w": random.uniform(0.3, 0.95),
            "b": random.uniform(-0.4, -0.1),
            "b0": random.uniform(0.2, 0.8),
            "h": random.uniform(0.02, 0.1),
            "roughness_deg": random.uniform(8.0, 30.0),
        }
    return {}


@group
def laws(random: Draw) -> Iterator[Fields]:
    """Laws x phases x sizes, twice; every fourth with a map of no real body."""
    place = 0
    for law in LAWS:
        for low_phase, high_phase in PHASES.values():
            for low, high in RADII.values():
                for _ in range(2):
                    fields = usual(random, place, law=law, radius_px=random.uniform(low, high))
                    fields["phase_deg"] = random.uniform(low_phase, high_phase)
                    if place % 4 == 2:
                        fields |= {"target": "triton", "surface": "procedural", "given": "procedural"}
                    yield fields
                    place += 1


@group
def small(random: Draw) -> Iterator[Fields]:
    """Disks of 8-28 px radius."""
    for place, radius in enumerate((8, 8, 10, 10, 12, 12, 16, 16, 20, 20, 24, 24, 28, 28)):
        yield usual(random, place, radius_px=float(radius), phase_deg=random.uniform(20, 80))


@group
def large(random: Draw) -> Iterator[Fields]:
    """Disks of 200-430 px radius, whole, and of 700-900 px cut by the frame."""
    for place, radius in enumerate((200.0, 250.0, 300.0, 350.0, 430.0)):
        yield usual(random, place, radius_px=radius, lens="lorri")
    for place, (radius, centre) in enumerate(
        ((700.0, (-0.1, 0.4)), (750.0, (0.9, 0.95)), (800.0, (0.2, -0.2)), (900.0, (1.15, 0.5)))
    ):
        yield usual(random, place, radius_px=radius, lens="lorri", centre=centre, phase_deg=random.uniform(20, 70))


@group
def crescents(random: Draw) -> Iterator[Fields]:
    """Phase angles of 135-160 deg."""
    for place, (radius, phase) in enumerate((r, p) for r in (45.0, 90.0, 140.0) for p in (135.0, 145.0, 153.0, 160.0)):
        yield usual(random, place, radius_px=radius, phase_deg=phase)


@group
def no_map(random: Draw) -> Iterator[Fields]:
    """Bodies that the catalog has no map of, textured all the same; orientation and range within their priors."""
    for place in range(20):
        low, high = tuple(RADII.values())[place % 3]
        low_phase, high_phase = tuple(PHASES.values())[(place // 3) % 4]
        fields = usual(random, place, radius_px=random.uniform(low, high))
        yield fields | {
            "target": UNMAPPED[place % len(UNMAPPED)],
            "surface": "procedural",
            "given": "none",
            "phase_deg": random.uniform(low_phase, high_phase),
        }
    for place, target in enumerate(("uranus", "neptune", "uranus", "neptune")):
        yield usual(random, place, target=target, law="minnaert", parameters={"k": 0.8}, phase_deg=15.0 + 35 * place)


def others_of(*others: Other) -> Fields:
    """Fields of a scene with other bodies."""
    return {"others": others}
