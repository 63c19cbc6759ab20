"""The published corrections: 57 poses against pure SPICE geometry, and neighbouring images against each other."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from catalog.europa57 import paper_images
from catalog.settings import default_kernels
from flows.paper.published_tables import (
    by_camera,
    camera_entry,
    camera_table,
    disagreement,
    image_table,
    pair_table,
    sigma_table,
)
from flows.paper.section import NO_DATA, Compared, Context, Picture, Section
from tasks.paper.published import (
    NEIGHBOURS_S,
    Neighbours,
    PublishedDifference,
    neighbours,
    published_differences,
)
from tasks.pictures.published_figure import disagreement_figure, published_figure, sunward_figure

NAME = "published"
TITLE = "The published corrections of 57 images of Europa"
TEXT = (
    "The supplement's poses against pure SPICE geometry (LT+S, pck00010, the kernels of the data folder). Range and "
    "direction say how far the paper's kernels and its factor kdist are from these; the turn of the body is what its "
    "optical flow found, here in the camera's axes, so that roll stands apart. Whatever is wrong with the kernels, the "
    "rotation model or the map is the same for two images that one camera took minutes apart: what their corrections "
    "disagree by is the correction's own error, and a single image's error is that by the square root of two.",
)


def published(context: Context) -> Section:
    """Every image, statistics per camera, and the disagreement of neighbours."""
    kernels = [context.data / "kernels"] if context.data else default_kernels()
    if not kernels:
        return Section(NAME, TITLE, missing=NO_DATA)
    found = published_differences(paper_images().values(), kernels)
    if all(each.range_factor is None for each in found):
        return Section(NAME, TITLE, missing=f"the kernels cover none of the images: {found[0].missing[0]}")
    pairs = neighbours(found)
    turned = [pair for pair in pairs if pair.turned]
    sigmas = disagreement(turned)
    return Section(
        NAME,
        TITLE,
        content={
            "images": [image_entry(each) for each in found],
            "cameras": {camera: camera_entry(own) for camera, own in by_camera(found).items()},
            "neighbours": {"within_s": NEIGHBOURS_S, "pairs": [pair_entry(pair) for pair in pairs], **sigmas},
        },
        compared=compared(found),
        tables=[camera_table(found), pair_table(turned), sigma_table(turned), image_table(found)],
        pictures=pictures(context, found, pairs),
        text=(*TEXT, *findings(found, turned, sigmas)),
    )


def image_entry(each: PublishedDifference) -> dict[str, Any]:
    """One image, plain JSON."""
    return {
        "image": each.image.image,
        "camera": each.image.camera,
        "et": each.image.pose.et,
        "kdist": each.image.range_factor,
        "range_factor": each.range_factor,
        "range_factor_before_kdist": each.range_factor_before,
        "direction_px": each.direction_px and list(each.direction_px),
        "turn_deg": None if each.turn_deg is None else each.turn_deg.tolist(),
        "turn_angle_deg": each.turn_angle_deg,
        "sunward_across_deg": each.sunward_across_deg and list(each.sunward_across_deg),
        "pointing_px": each.pointing_px and list(each.pointing_px),
        "camera_roll_deg": each.camera_roll_deg,
        "not_covered": list(each.missing),
    }


def pair_entry(pair: Neighbours) -> dict[str, Any]:
    """Two images, plain JSON."""
    return {
        "images": [pair.first.image.image, pair.second.image.image],
        "seconds": round(pair.seconds, 3),
        "turn_deg": pair.turn_deg.tolist(),
        "angle_deg": pair.angle_deg,
        "surface_px": pair.surface_px,
        "kdist": pair.range_factor,
        "turned": pair.turned,
    }


def compared(found: Sequence[PublishedDifference]) -> list[Compared]:
    """What the paper says of its distance factors, and what its published poses say against our kernels."""
    voyager = [each for each in found if each.image.camera.startswith("voyager")]
    factors = [each.image.range_factor for each in voyager]
    against = [each.range_factor for each in voyager if each.range_factor is not None]
    note = "the paper: between 99 % and 101 %, always overestimated; ours: its own supplement"
    return [
        Compared("smallest distance factor (kdist)", 0.99, min(factors), "", 4, note),
        Compared("largest distance factor (kdist)", 1.0, max(factors), "", 4, note),
        Compared("images at the edge of its scan, 0.985", None, float(sum(f == 0.985 for f in factors)), "", 0),
        Compared("smallest published range / SPICE", None, min(against, default=None), "", 4),
        Compared("largest published range / SPICE", None, max(against, default=None), "", 4),
    ]


def findings(found: Sequence[PublishedDifference], pairs: Sequence[Neighbours], sigmas: dict[str, Any]) -> list[str]:
    """What the figures say, in sentences."""
    alone = [each for each in found if each.turn_deg is not None and not each.turned]
    uncovered = sum(each.pointing_px is None for each in found)
    known = len(found) - uncovered
    said = [
        f"Trajectories and rotation model cover {sum(each.range_factor is not None for each in found)} of the "
        f"{len(found)} images, C-kernels {known}"
        + (": the published camera orientation itself has nothing to be compared with here." if known == 0 else "."),
        f"{len(alone)} images carry the attitude of SPICE (turn below 0.03 deg): their optical flow was not used, or "
        "found nothing.",
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
    return said + sunward(found)


def sunward(found: Sequence[PublishedDifference]) -> list[str]:
    """Whether a camera's turns point along the Sun's direction, in a sentence for those that do."""
    said = []
    for camera, own in by_camera(found).items():
        moves = np.array([each.sunward_across_deg for each in own if each.turned and (each.turn_angle_deg or 0) < 5])
        if len(moves) < 3:
            continue
        along, across = np.abs(moves).max(axis=0)
        one_sided = abs(np.sign(moves[:, 0]).sum()) == len(moves)
        if one_sided and across < 0.2 * along:
            low, high = sorted(np.abs(moves[:, 0]))[:: len(moves) - 1]
            way = "away from" if moves[0, 0] < 0 else "towards"
            said.append(
                f"All {len(moves)} turns of {camera} (outliers beyond 5 deg apart) move the markings straight {way} "
                f"the Sun, by {low:.2f} to {high:.2f} deg, and at most {across:.2f} deg across, wherever the Sun "
                "stands in the image. A wrong rotation model or camera roll does not know where the Sun is; shading "
                "that the simulation lacks does. So these corrections are most likely an artefact of photometry."
            )
    return said


def pictures(context: Context, found: Sequence[PublishedDifference], pairs: Sequence[Neighbours]) -> list[Picture]:
    """Turns and ranges image by image; disagreement of neighbours."""
    return [
        Picture(
            context.save(published_figure(found, pairs), "published"),
            "Turn of Europa that the paper applied (lines join neighbours; clipped at 2 deg), and published range over "
            "that of the kernels.",
        ),
        Picture(
            context.save(sunward_figure(found), "published-sunward"),
            "Where the corrections move the markings in mid-disk, every image turned so that the Sun is above.",
        ),
        Picture(
            context.save(disagreement_figure(pairs), "published-neighbours"),
            f"How far the corrections of images at most {NEIGHBOURS_S:.0f} s apart disagree.",
        ),
    ]
