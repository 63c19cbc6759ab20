"""The published corrections: 57 poses against pure SPICE geometry, and neighbouring images against each other."""

from collections.abc import Sequence
from typing import Any

from catalog.settings import default_kernels
from lab.paper.published_figure import disagreement_figure, longitude_figure, published_figure
from lab.paper.published_findings import findings
from lab.paper.published_geometry import (
    NEIGHBOURS_S,
    Neighbours,
    PublishedDifference,
    neighbours,
    published_differences,
)
from lab.paper.published_tables import (
    by_camera,
    camera_entry,
    camera_table,
    disagreement,
    image_table,
    pair_table,
    sigma_table,
)
from lab.paper.section import NO_DATA, Compared, Context, Picture, Section
from lab.simulate.europa57 import paper_images

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
        "turn_in_body_deg": None if each.turn_in_body_deg is None else each.turn_in_body_deg.tolist(),
        "sub_spacecraft_deg": list(each.sub_spacecraft_deg),
        "sun_in_east": each.sun_in_east,
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


def pictures(context: Context, found: Sequence[PublishedDifference], pairs: Sequence[Neighbours]) -> list[Picture]:
    """Turns and ranges image by image; disagreement of neighbours."""
    return [
        Picture(
            context.save(published_figure(found, pairs), "published"),
            "Turn of Europa that the paper applied (lines join neighbours; clipped at 2 deg), and published range over "
            "that of the kernels.",
        ),
        Picture(
            context.save(longitude_figure(found), "published-longitude"),
            "How far the corrections move the markings east, against the longitude in mid-disk (clipped at 2 deg).",
        ),
        Picture(
            context.save(disagreement_figure(pairs), "published-neighbours"),
            f"How far the corrections of images at most {NEIGHBOURS_S:.0f} s apart disagree.",
        ),
    ]
