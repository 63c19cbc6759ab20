"""The overlay picture: image, predicted and corrected limb, latitude and longitude lines, terminator, other bodies and
stars."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera
from catalog.pose import Pose
from catalog.target import Target
from tasks.bodies.placed import bodies_of, in_frame
from tasks.bodies.seen import has_company, seen_by_frame
from tasks.project.curves import Curve, graticule, limb, terminator
from tasks.project.points import latitude_longitude
from tasks.publish.framing import Box, box_of, close_up, union

if TYPE_CHECKING:
    from tasks.publish.drawing import Panel, Picture

# Okabe and Ito's colours, which colour-blind eyes distinguish; line styles differ too.
PREDICTED: dict[str, Any] = {"color": "#E69F00", "linestyle": (0, (6, 4)), "linewidth": 1.6}
CORRECTED: dict[str, Any] = {"color": "#56B4E9", "linestyle": "-", "linewidth": 1.6}
TERMINATOR: dict[str, Any] = {"color": "#F0E442", "linestyle": (0, (1, 1.6)), "linewidth": 1.8}
GRID: dict[str, Any] = {"color": "white", "linestyle": "-", "linewidth": 0.6, "alpha": 0.6}
OTHER: dict[str, Any] = {"color": "#CC79A7", "linestyle": "-", "linewidth": 1.4}
RING: dict[str, Any] = {"color": "#CC79A7", "linestyle": ":", "linewidth": 0.9}
SHADOW: dict[str, Any] = {"color": "#D55E00", "linestyle": "--", "linewidth": 1.2}
STAR: dict[str, Any] = {"color": "#009E73", "linestyle": "-", "linewidth": 1.2}
NO_STAR: dict[str, Any] = {"color": "#E69F00", "linestyle": "-", "linewidth": 1.0}
STAR_SHARE = 0.008  # half width of a star's mark, of the width that a panel shows
OTHER_POINTS = 1440
GRID_STEP_DEG = 30.0
LABEL_COSINE = 0.3  # of emission, below which grid labels would crowd
GAMMA = 0.65
# Pixels of the canvas: its width with one panel, and margins for ticks, title, legend.
WIDTH_PX, LEFT_PX, RIGHT_PX, TITLE_PX, BOTTOM_PX = 880, 62, 14, 44, 84
HEIGHT_PX = (385, 1155)  # of a panel, least and most


def draw_overlay(
    image: NDArray[np.float32],
    pose_before: Pose,
    pose_after: Pose,
    camera: Camera,
    target: Target,
    path: Path,
    title: str = "",
    found: str = "corrected limb",
    stars: Mapping[str, Any] | None = None,
) -> Path:
    """Write the overlay of an undistorted image (ny, nx) as PNG and return its path.

    The picture is cut to the target; when the predicted limb lies far from the corrected one, a second panel shows the
    whole frame with both; so it does where stars are known. found: what the limb of `pose_after` is called. stars: what
    a result says of them.
    """
    before, after = limb(pose_before, camera, target), limb(pose_after, camera, target)
    frame = Box(-0.5, -0.5, camera.size_px[0] - 0.5, camera.size_px[1] - 0.5)
    box, far_apart = close_up(box_of(before.xy_px), box_of(after.xy_px), frame)
    far_apart = far_apart or (bool(stars and stars.get("matches")) and box != frame)
    boxes = [box, union(frame, box_of(before.xy_px), box_of(after.xy_px))] if far_apart else [box]
    picture, panels = _canvas(boxes)
    shown = stretched(image)
    for panel in panels:
        panel.image(shown)
    lines = graticule(pose_after, camera, target, GRID_STEP_DEG)
    panels[0].curves([line.visible_xy_px for line in lines], GRID, edge=(1.2, 0.35))
    for label in grid_labels(lines, pose_after, target):
        panels[0].label(*label)
    panels[0].curves([terminator(pose_after, camera, target).visible_xy_px], TERMINATOR)
    legend = [("terminator", TERMINATOR), (found, CORRECTED), ("predicted limb", PREDICTED)]
    for panel in panels:
        panel.curves([_closed(after.xy_px)], CORRECTED)
        panel.curves([_closed(before.xy_px)], PREDICTED)
    legend += _draw_others(panels, pose_after, camera, target)
    legend += _draw_stars(panels, boxes, stars or {})
    for panel in panels:
        panel.axes()
    if far_apart:
        picture.text((panels[1].left + panels[1].width / 2, panels[1].top - 6), "whole frame", 9, "mb")
    picture.text((picture.rgb.shape[1] / 2, TITLE_PX / 2), title, 10)
    picture.legend(legend, picture.rgb.shape[0] - 8)
    picture.save(path)
    return Path(path)


def _canvas(boxes: list[Box]) -> "tuple[Picture, list[Panel]]":
    """A canvas with a panel for each part of the frame, the second in two thirds of the first one's width."""
    from tasks.publish.drawing import Panel, Picture

    width = WIDTH_PX - LEFT_PX - RIGHT_PX
    height = int(np.clip(width * boxes[0].height / boxes[0].width, *HEIGHT_PX))
    picture = Picture(round(WIDTH_PX * (5 / 3 if len(boxes) > 1 else 1)), TITLE_PX + height + BOTTOM_PX)
    panels = [Panel(picture, boxes[0], LEFT_PX, TITLE_PX, (width, height))]
    if len(boxes) > 1:
        second = round(WIDTH_PX * 2 / 3) - LEFT_PX - RIGHT_PX
        panels.append(Panel(picture, boxes[1], WIDTH_PX + LEFT_PX, TITLE_PX, (second, height)))
    return picture, panels


def _closed(xy_px: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.vstack([xy_px, xy_px[:1]])


def stretched(image: NDArray[np.float32]) -> NDArray[np.float32]:
    """Grey values 0-1 that show dark and bright parts at once: from sky to the 99.9th percentile, with a gamma."""
    return greys(image, *grey_limits(image))


def grey_limits(image: NDArray[np.float32]) -> tuple[float, float]:
    """The values that are drawn black and white; (0, 0) where nothing is known."""
    finite = image[np.isfinite(image)]
    low, high = np.percentile(finite, [2.0, 99.9]) if finite.size else (0.0, 0.0)
    return float(low), float(high)


def greys(image: NDArray[np.float32], low: float, high: float) -> NDArray[np.float32]:
    """Grey values 0-1 between two limits; what is unknown is black."""
    scale = max(high - low, 1e-30)
    return (np.clip((np.nan_to_num(image, nan=low) - low) / scale, 0.0, 1.0) ** GAMMA).astype(np.float32)


Label = tuple[str, tuple[float, float], tuple[float, float]]


def grid_labels(lines: list[Curve], pose: Pose, target: Target) -> list[Label]:
    """Text, pixel and shift in points of the grid's labels: latitudes along the meridian, longitudes along the parallel
    nearest to the disk's centre, only where the surface is not too foreshortened."""
    latitude, longitude = (float(v) for v in latitude_longitude(pose.spacecraft_in_body_km))
    here_lat = float(np.clip(GRID_STEP_DEG * round(latitude / GRID_STEP_DEG), -60, 60))
    here_lon = GRID_STEP_DEG * round(longitude / GRID_STEP_DEG) % 360
    labels: list[Label] = []
    for line in lines:
        kind, value = line.name.split()[0], float(line.name.split()[1])
        lat, lon = latitude_longitude(line.points_km)
        at = int(np.argmin(np.abs(lon - here_lon) if kind == "latitude" else np.abs(lat - here_lat)))
        if _emission_cosine(pose, target, line.points_km[at]) < LABEL_COSINE or not np.isfinite(line.xy_px[at]).all():
            continue
        text = f"{value:g}E" if kind == "longitude" else f"{abs(value):g}{'S' if value < 0 else 'N' if value else ''}"
        shift = (14.0, -7.0) if kind == "longitude" else (-12.0, 7.0)
        labels.append((text, (float(line.xy_px[at][0]), float(line.xy_px[at][1])), shift))
    return labels


def _emission_cosine(pose: Pose, target: Target, point_km: NDArray[np.float64]) -> float:
    normal = point_km / np.asarray(target.radii_km) ** 2
    sight = pose.spacecraft_in_body_km - point_km
    return float(normal @ sight / np.linalg.norm(normal) / np.linalg.norm(sight))


def _draw_others(
    panels: "Sequence[Panel]", pose: Pose, camera: Camera, target: Target
) -> list[tuple[str, dict[str, Any]]]:
    """Limbs of the other bodies, rings' edges, and the edge of the shadows on what is seen; what the legend says."""
    if not has_company(pose, camera, target):
        return []
    legend = []
    bodies = [body for body in bodies_of(pose, target) if in_frame(body, camera)]
    limbs = [limb(each.pose, camera, each.target, OTHER_POINTS).xy_px for each in bodies if each.place is not None]
    rings = [
        _circle(each.pose, camera, radius)
        for each in bodies
        for ring in each.target.rings
        for radius in (ring.inner_km, ring.outer_km)
    ]
    shadow = np.nan_to_num(seen_by_frame(pose, camera, target).shadow)
    edges: list[NDArray[np.float64]] = []
    if shadow.max() > 0.5:
        from skimage.measure import find_contours

        edges = [contour[:, ::-1] for contour in find_contours(shadow, 0.5)]
    for panel in panels:
        panel.curves(limbs, OTHER)
        panel.curves(rings, RING)
        panel.curves(edges, SHADOW)
    if limbs:
        legend.append(("other bodies", OTHER))
    if edges:
        legend.append(("shadow", SHADOW))
    return legend


def _draw_stars(
    panels: "Sequence[Panel]", boxes: Sequence[Box], stars: Mapping[str, Any]
) -> list[tuple[str, dict[str, Any]]]:
    """Rings around identified stars, squares around star images that are none of the catalog's; the legend's words."""
    angle = np.linspace(0, 2 * np.pi, 25)
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    square = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0]])
    legend = []
    for key, shape, style, words in (
        ("matches", ring, STAR, "identified stars"),
        ("unidentified", square, NO_STAR, "star images not identified"),
    ):
        places = [np.array([each["x_px"], each["y_px"]]) for each in stars.get(key) or []]
        for panel, box in zip(panels, boxes, strict=True):
            panel.curves([place + STAR_SHARE * box.width * shape for place in places], style)
        if places:
            legend.append((words, style))
    return legend


def _circle(pose: Pose, camera: Camera, radius_km: float) -> NDArray[np.float64]:
    """A circle in the body's equator, pixels (n, 2); NaN behind the camera."""
    angle = np.linspace(0, 2 * np.pi, OTHER_POINTS)
    points = radius_km * np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=-1)
    return camera.project((points @ pose.body_from_j2000 + pose.target_from_spacecraft_km) @ pose.camera_from_j2000.T)
