"""Statistics and tables of the published corrections: per camera, per pair of neighbours, per image."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from lab.paper.published_geometry import Neighbours, PublishedDifference, one_image_sigma
from lab.paper.section import Cell, Table

Figures = Callable[[PublishedDifference], float | None]


def by_camera(found: Sequence[PublishedDifference]) -> dict[str, list[PublishedDifference]]:
    """The images of each camera."""
    cameras = dict.fromkeys(each.image.camera for each in found)
    return {camera: [each for each in found if each.image.camera == camera] for camera in cameras}


def statistics(values: Sequence[float | None]) -> dict[str, float] | None:
    """Count, mean, median, smallest and largest of what is known."""
    known = np.array([value for value in values if value is not None], float)
    if known.size == 0:
        return None
    numbers = {"mean": known.mean(), "median": np.median(known), "min": known.min(), "max": known.max()}
    return {"images": int(known.size)} | {name: float(value) for name, value in numbers.items()}


FIGURES: dict[str, Figures] = {
    "range_ppm": lambda d: None if d.range_factor is None else 1e6 * (d.range_factor - 1),
    "range_before_kdist_ppm": lambda d: None if d.range_factor_before is None else 1e6 * (d.range_factor_before - 1),
    "direction_px": lambda d: None if d.direction_px is None else float(np.hypot(*d.direction_px)),
    "turn_deg": lambda d: d.turn_angle_deg,
    "turn_px": lambda d: d.turn_px,
    "about_pole_deg": lambda d: float(d.turn_in_body_deg[2]) if d.turned and d.turn_in_body_deg is not None else None,
    "roll_deg": lambda d: None if d.turn_deg is None else abs(float(d.turn_deg[2])),
}


def camera_entry(own: Sequence[PublishedDifference]) -> dict[str, Any]:
    """Statistics of one camera; which images no C-kernel covers."""
    return {
        **{name: statistics([figure(each) for each in own]) for name, figure in FIGURES.items()},
        "attitude_left_alone": sum(not each.turned for each in own),
        "without_c_kernel": sum(each.pointing_px is None for each in own),
    }


def disagreement(pairs: Sequence[Neighbours]) -> dict[str, Any]:
    """Distribution of what neighbours disagree by, and the error of one image that follows."""
    angles = [pair.angle_deg for pair in pairs]
    components = np.array([pair.turn_deg for pair in pairs]).reshape(-1, 3)
    moved = [pair for pair in pairs if pair.first.image.camera.startswith("voyager")]
    return {
        "turned_pairs": len(pairs),
        "angle_deg": statistics(angles),
        "surface_px": statistics([pair.surface_px for pair in pairs]),
        "one_image_sigma_deg": {
            name: one_image_sigma(components[:, axis].tolist()) for axis, name in enumerate(("x", "y", "roll"))
        },
        "one_image_sigma_kdist": one_image_sigma([pair.range_factor for pair in moved]),
        "largest_kdist_disagreement": max((abs(pair.range_factor) for pair in moved), default=None),
    }


def camera_table(found: Sequence[PublishedDifference]) -> Table:
    """Per camera: median and largest."""
    header = ("camera", "images", "range, ppm", "without kdist, ppm", "direction, px", "turn, deg", "largest",
              "mid-disk, px", "largest", "about pole, deg",
              "|roll|, deg", "left alone", "no CK")  # fmt: skip
    rows: list[list[Cell]] = []
    for camera, own in by_camera(found).items():
        entry = camera_entry(own)

        def value(name: str, which: str = "median", entry: dict[str, Any] = entry) -> float | None:
            return entry[name] and entry[name][which]

        rows.append([
            camera, len(own), value("range_ppm"), value("range_before_kdist_ppm"), value("direction_px"),
            value("turn_deg"), value("turn_deg", "max"), value("turn_px"), value("turn_px", "max"),
            value("about_pole_deg"), value("roll_deg"),
            entry["attitude_left_alone"], entry["without_c_kernel"],
        ])  # fmt: skip
    return Table("Published minus SPICE: medians per camera", header, rows)


def pair_table(pairs: Sequence[Neighbours]) -> Table:
    """Every pair whose attitude was corrected."""
    header = ("first", "second", "seconds apart", "about x, deg", "about y, deg", "roll, deg", "angle, deg",
              "mid-disk, px", "kdist")  # fmt: skip
    rows = [
        (p.first.image.image, p.second.image.image, f"{p.seconds:.0f}", *p.turn_deg.tolist(), p.angle_deg,
         p.surface_px, f"{p.range_factor:+.4f}")
        for p in pairs
    ]  # fmt: skip
    return Table("Neighbours: second minus first correction", header, rows)


def sigma_table(pairs: Sequence[Neighbours]) -> Table:
    """Error of one image, per camera, from its neighbours."""
    cameras = dict.fromkeys(pair.first.image.camera for pair in pairs)
    rows = []
    for camera in cameras:
        own = disagreement([pair for pair in pairs if pair.first.image.camera == camera])
        sigma = own["one_image_sigma_deg"]
        rows.append([camera, own["turned_pairs"], own["angle_deg"]["median"], own["angle_deg"]["max"],
                     sigma["x"], sigma["y"], sigma["roll"]])  # fmt: skip
    header = ("camera", "pairs", "median, deg", "largest, deg", "sigma about x", "sigma about y", "sigma roll")
    return Table("What one published attitude is good to (robust 1-sigma, deg)", header, rows)


def image_table(found: Sequence[PublishedDifference]) -> Table:
    """Every image."""
    header = ("image", "camera", "kdist", "published / SPICE range", "direction x, px", "y, px", "turn about x, deg",
              "about y", "roll", "angle", "about pole", "seen at deg E", "Sun")  # fmt: skip
    none = [None] * 3
    rows = [
        (d.image.image, d.image.camera, f"{d.image.range_factor:.4f}",
         None if d.range_factor is None else f"{d.range_factor:.6f}", *(d.direction_px or none[:2]),
         *(none if d.turn_deg is None else d.turn_deg.tolist()), d.turn_angle_deg,
         None if d.turn_in_body_deg is None else float(d.turn_in_body_deg[2]), f"{d.sub_spacecraft_deg[1]:.0f}",
         "east" if d.sun_in_east else "west")
        for d in found
    ]  # fmt: skip
    return Table("Every image", header, rows)
