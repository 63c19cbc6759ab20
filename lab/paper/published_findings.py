"""What the published corrections say, in sentences made of their figures."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from lab.paper.published_geometry import Neighbours, PublishedDifference

PLAUSIBLE_DEG = 5.0
LONGITUDE_STEP_DEG, ENOUGH_IMAGES = 60, 3


def findings(found: Sequence[PublishedDifference], pairs: Sequence[Neighbours], sigmas: dict[str, Any]) -> list[str]:
    """What the figures say, in sentences."""
    alone = [each for each in found if each.turn_deg is not None and not each.turned]
    uncovered = sum(each.pointing_px is None for each in found)
    known = len(found) - uncovered
    said = [
        f"Trajectories and rotation model cover {sum(each.range_factor is not None for each in found)} of the "
        f"{len(found)} images, C-kernels {known}"
        + (": the published camera orientation itself has nothing to be compared with here." if known == 0 else "."),
        f"{len(alone)} images carry the attitude of SPICE at the time of exposure: {angles_text(alone)}. Their optical "
        "flow was not used, or found nothing.",
    ]
    sigma = sigmas["one_image_sigma_deg"]
    if sigmas["angle_deg"] and None not in sigma.values():
        worst = max(pairs, key=lambda pair: pair.angle_deg)
        said.append(
            f"Neighbours disagree in attitude by {sigmas['angle_deg']['median']:.2f} deg (median of "
            f"{len(pairs)} pairs), at most by {worst.angle_deg:.1f} deg ({worst.first.image.image} and "
            f"{worst.second.image.image}, {worst.seconds:.0f} s apart). So one published attitude is good to about "
            f"{sigma['x']:.2f}, {sigma['y']:.2f} and {sigma['roll']:.2f} deg (about x, y and the boresight; robust "
            "1-sigma), while the corrections themselves have a median of "
            f"{np.median([each.turn_angle_deg for each in found if each.turned]):.2f} deg: noise and correction are "
            "of one size."
        )
    return said + about_the_pole(found)


def angles_text(alone: Sequence[PublishedDifference]) -> str:
    """How far attitudes that were left alone differ from SPICE's at the time when the light left, and why."""
    angles = np.array([each.turn_angle_deg for each in alone], float)
    if angles.size == 0:
        return "none"
    expected = np.array([each.turned_while_light_travelled_deg for each in alone])
    because = ", what Europa turns while its light travels" if np.abs(angles - expected).max() < 2e-3 else ""
    return f"they differ by {angles.min():.3f} to {angles.max():.3f} deg{because}"


def about_the_pole(found: Sequence[PublishedDifference]) -> list[str]:
    """What turns about the pole say: those of LORRI, and of sides of Europa seen with the Sun in the east and west."""
    said = []
    lorri = [each for each in found if each.image.camera == "newhorizons-lorri" and is_plausible(each)]
    if lorri:
        axes = np.array([each.turn_in_body_deg for each in lorri])
        said.append(
            f"LORRI's {len(lorri)} turns below {PLAUSIBLE_DEG:.0f} deg are about Europa's pole and nothing else: "
            f"{axes[:, 2].min():+.2f} to {axes[:, 2].max():+.2f} deg, eastward, against at most "
            f"{np.abs(axes[:, :2]).max():.2f} deg about the other axes."
        )
    for middle in range(0, 360, LONGITUDE_STEP_DEG):
        near = [
            e
            for e in found
            if is_plausible(e) and _apart_deg(e.sub_spacecraft_deg[1], middle) <= LONGITUDE_STEP_DEG / 2
        ]
        west, east = (
            [float(e.turn_in_body_deg[2]) for e in near if e.turn_in_body_deg is not None and e.sun_in_east == in_east]
            for in_east in (False, True)
        )
        if min(len(west), len(east)) >= ENOUGH_IMAGES:
            said.append(f"Around {middle} deg east, {sides_text(west, east)}")
    return said


def is_plausible(each: PublishedDifference) -> bool:
    """Whether the attitude was corrected, and by no outlier."""
    return each.turned and (each.turn_angle_deg or 0.0) < PLAUSIBLE_DEG


def _apart_deg(a: float, b: float) -> float:
    return abs((a - b + 180) % 360 - 180)


def sides_text(west: Sequence[float], east: Sequence[float]) -> str:
    """How far markings were moved east with the Sun in the west and in the east, and what is common to both."""
    middles = np.median(west), np.median(east)
    error = np.hypot(*(np.std(group, ddof=1) / np.sqrt(len(group)) for group in (west, east))) / 2
    common, odd = (middles[1] + middles[0]) / 2, (middles[1] - middles[0]) / 2
    return (
        f"markings were moved east by {middles[0]:+.2f} deg (median of {len(west)} images with the Sun in the west) "
        f"and by {middles[1]:+.2f} deg ({len(east)} with the Sun in the east). The part common to both, {common:+.2f} "
        f"+- {error:.2f} deg, is what base map or rotation model are off by there; the part that changes sign with the "
        f"Sun, {odd:+.2f} +- {error:.2f} deg, is what shading pulls."
    )
