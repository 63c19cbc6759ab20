"""The overlay picture: image, predicted and corrected limb, latitude and longitude lines, terminator."""

import threading
from collections.abc import Iterable
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
    from matplotlib.axes import Axes

# Okabe and Ito's colours, which colour-blind eyes distinguish; line styles differ too.
PREDICTED: dict[str, Any] = {"color": "#E69F00", "linestyle": (0, (6, 4)), "linewidth": 1.6}
CORRECTED: dict[str, Any] = {"color": "#56B4E9", "linestyle": "-", "linewidth": 1.6}
TERMINATOR: dict[str, Any] = {"color": "#F0E442", "linestyle": (0, (1, 1.6)), "linewidth": 1.8}
GRID: dict[str, Any] = {"color": "white", "linestyle": "-", "linewidth": 0.6, "alpha": 0.6}
OTHER: dict[str, Any] = {"color": "#CC79A7", "linestyle": "-", "linewidth": 1.4}
RING: dict[str, Any] = {"color": "#CC79A7", "linestyle": ":", "linewidth": 0.9}
SHADOW = "#D55E00"
OTHER_POINTS = 1440
GRID_STEP_DEG = 30.0
LABEL_COSINE = 0.3  # of emission, below which grid labels would crowd
GAMMA = 0.65
DPI = 110
SIDE_INCHES = 8.0
PNG_LEVEL = 3  # in two thirds of the time as small as the usual 6

_MATPLOTLIB_LOCK = threading.Lock()  # its font machinery is not made for threads


def draw_overlay(
    image: NDArray[np.float32],
    pose_before: Pose,
    pose_after: Pose,
    camera: Camera,
    target: Target,
    path: Path,
    title: str = "",
    found: str = "corrected limb",
) -> Path:
    """Write the overlay of an undistorted image (ny, nx) as PNG and return its path.

    The picture is cut to the target; when the predicted limb lies far from the corrected one, a second panel shows the
    whole frame with both. found: what the limb of `pose_after` is called.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from PIL import Image

    before, after = limb(pose_before, camera, target), limb(pose_after, camera, target)
    frame = Box(-0.5, -0.5, camera.size_px[0] - 0.5, camera.size_px[1] - 0.5)
    box, far_apart = close_up(box_of(before.xy_px), box_of(after.xy_px), frame)
    with _MATPLOTLIB_LOCK:
        figure = Figure(figsize=_figure_inches(box, far_apart), dpi=DPI, layout="constrained")
        canvas = FigureCanvasAgg(figure)
        panels = figure.subplots(1, 2 if far_apart else 1, width_ratios=(3, 2) if far_apart else (1,), squeeze=False)[0]
        shown = stretched(image)
        _draw_body(panels[0], shown, box, pose_after, camera, target)
        _draw_limbs(panels[0], before, after, found)
        _draw_others(panels, pose_after, camera, target)
        if far_apart:
            _show(panels[1], shown, union(frame, box_of(before.xy_px), box_of(after.xy_px)))
            _draw_limbs(panels[1], before, after, found)
            panels[1].set_title("whole frame", fontsize=9)
        figure.suptitle(title, fontsize=10)
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(
            handles, labels, loc="outside lower center", ncols=4, fontsize=9, facecolor="#333333", labelcolor="white"
        )
        # `savefig` would draw everything twice.
        canvas.draw()
        picture = Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3])
    picture.save(path, format="PNG", dpi=(DPI, DPI), compress_level=PNG_LEVEL)
    return Path(path)


def stretched(image: NDArray[np.float32]) -> NDArray[np.float32]:
    """Grey values 0-1 that show dark and bright parts at once: from sky to the 99.9th percentile, with a gamma."""
    finite = image[np.isfinite(image)]
    if not finite.size:
        return np.zeros_like(image)
    low, high = np.percentile(finite, [2.0, 99.9])
    scale = max(float(high - low), 1e-30)
    return (np.clip((np.nan_to_num(image, nan=low) - low) / scale, 0.0, 1.0) ** GAMMA).astype(np.float32)


def _figure_inches(box: Box, far_apart: bool) -> tuple[float, float]:
    panel = float(np.clip((SIDE_INCHES - 0.7) * box.height / box.width, 3.5, 10.5))
    return SIDE_INCHES * (5 / 3 if far_apart else 1.0), panel + 1.4


def _show(axes: "Axes", shown: NDArray[np.float32], box: Box) -> None:
    axes.imshow(shown, cmap="gray", vmin=0, vmax=1, origin="upper")
    axes.set_facecolor("#202020")
    axes.set_xlim(box.x0, box.x1)
    axes.set_ylim(box.y1, box.y0)
    axes.set_xlabel("x (px)", fontsize=8)
    axes.set_ylabel("y (px)", fontsize=8)
    axes.tick_params(labelsize=8)


def _draw_body(axes: "Axes", shown: NDArray[np.float32], box: Box, pose: Pose, camera: Camera, target: Target) -> None:
    _show(axes, shown, box)
    lines = graticule(pose, camera, target, GRID_STEP_DEG)
    for line in lines:
        axes.plot(*line.visible_xy_px.T, path_effects=_dark_edge(1.2, 0.35), **GRID)
    for text, xy, shift in grid_labels(lines, pose, target):
        axes.annotate(
            text, xy, xytext=shift, textcoords="offset points", ha="center", va="center", fontsize=7,
            color="white", annotation_clip=True, path_effects=_dark_edge(1.6, 0.8),
        )  # fmt: skip
    axes.plot(*terminator(pose, camera, target).visible_xy_px.T, label="terminator", **TERMINATOR)


def _dark_edge(width: float, alpha: float) -> list[Any]:
    """White that stays legible on a bright surface."""
    from matplotlib.patheffects import Normal, Stroke

    return [Stroke(linewidth=width, foreground="black", alpha=alpha), Normal()]


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


def _draw_others(panels: Iterable["Axes"], pose: Pose, camera: Camera, target: Target) -> None:
    """Limbs of the other bodies, rings' edges, and the edge of the shadows on what is seen."""
    if not has_company(pose, camera, target):
        return
    label: str | None = "other bodies"
    bodies = [body for body in bodies_of(pose, target) if in_frame(body, camera)]
    shadow = np.nan_to_num(seen_by_frame(pose, camera, target).shadow)
    for axes in panels:
        limits = axes.get_xlim(), axes.get_ylim()
        for body in bodies:
            if body.place is not None:
                x, y = limb(body.pose, camera, body.target, OTHER_POINTS).xy_px.T
                axes.plot(x, y, label=label, **OTHER)
                label = None
            for ring in body.target.rings:
                for radius in (ring.inner_km, ring.outer_km):
                    x, y = _circle(body.pose, camera, radius).T
                    axes.plot(x, y, **RING)
        if shadow.max() > 0.5:
            axes.contour(shadow, levels=[0.5], colors=[SHADOW], linewidths=1.2, linestyles="dashed")
            axes.plot([], [], color=SHADOW, linestyle="--", linewidth=1.2, label="shadow")
        axes.set_xlim(*limits[0])
        axes.set_ylim(*limits[1])


def _circle(pose: Pose, camera: Camera, radius_km: float) -> NDArray[np.float64]:
    """A circle in the body's equator, pixels (n, 2); NaN behind the camera."""
    angle = np.linspace(0, 2 * np.pi, OTHER_POINTS)
    points = radius_km * np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=-1)
    return camera.project((points @ pose.body_from_j2000 + pose.target_from_spacecraft_km) @ pose.camera_from_j2000.T)


def _draw_limbs(axes: "Axes", before: Curve, after: Curve, found: str) -> None:
    for curve, style, label in ((after, CORRECTED, found), (before, PREDICTED, "predicted limb")):
        x, y = np.vstack([curve.xy_px, curve.xy_px[:1]]).T
        axes.plot(x, y, label=label, **style)
