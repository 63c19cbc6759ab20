"""Mitsuba renders where each ray meets the target; cosines and laws follow, so that one render serves many laws."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.basemap import BaseMap
from catalog.camera import Camera
from catalog.pose import Pose
from catalog.target import Target
from tasks.renderer import mitsuba, rendered
from tasks.simulate.closed_form import ellipsoid_surface
from tasks.simulate.surface_loop import sampled_surface
from tasks.simulate.window import Window

Image = NDArray[np.float32]
Samples = tuple[NDArray[np.bool_], Image, Image, Image]

# The ring along the lit limb that Mitsuba renders: squares of so many pixels that hold all within a reach of the limb,
# in which the steps of brightness are that the limb is measured by.
SQUARE_PX, REACH_PX = 12, 5


def rendered_surface(
    pose: Pose, camera: Camera, target: Target, basemap: BaseMap, window: Window, oversample: int
) -> Samples:
    """Hit, cosine of incidence (0 at night), of emission, and albedo (ny*s, nx*s), as `ellipsoid_surface`."""
    return _sampled(render_positions(pose, camera, target, window, oversample), pose, target, basemap)


def surface_with_rendered_limb(
    pose: Pose, camera: Camera, target: Target, basemap: BaseMap, window: Window, oversample: int
) -> Samples:
    """The same, rendered in a ring along the lit limb only, in closed form elsewhere."""
    surface = ellipsoid_surface(pose, camera, target, basemap, window, oversample)
    hit, mu0 = surface[0][::oversample, ::oversample], surface[1][::oversample, ::oversample]
    scene = _scene(pose, camera, target, window, oversample)
    film = mitsuba().traverse(scene)
    for square in squares_along(hit, mu0 > 0):
        rows = slice(square.y0 * oversample, square.y1 * oversample)
        columns = slice(square.x0 * oversample, square.x1 * oversample)
        film["sensor.film.crop_offset"] = [columns.start, rows.start]
        film["sensor.film.crop_size"] = [columns.stop - columns.start, rows.stop - rows.start]
        film.update()
        seen = _sampled(rendered(scene)[..., -3:], pose, target, basemap)
        for whole, values in zip(surface, seen, strict=True):
            whole[rows, columns] = values
    return surface


def _sampled(points: Image, pose: Pose, target: Target, basemap: BaseMap) -> Samples:
    return sampled_surface(
        points,
        target.mean_radius_km,
        np.array(target.radii_km, np.float64),
        np.ascontiguousarray(pose.spacecraft_in_body_km, np.float64),
        np.ascontiguousarray(pose.sun_direction_in_body, np.float64),
        np.ascontiguousarray(basemap.albedo, np.float32),
        float(basemap.left_edge_deg),
    )


def squares_along(hit: NDArray[np.bool_], lit: NDArray[np.bool_]) -> list[Window]:
    """Squares of pixels (ny, nx) that together hold all that is within REACH_PX of a lit edge of `hit`."""
    ny, nx = hit.shape
    across = np.argwhere((hit[1:] != hit[:-1]) & (lit[1:] | lit[:-1]))
    along = np.argwhere((hit[:, 1:] != hit[:, :-1]) & (lit[:, 1:] | lit[:, :-1]))
    steps = [(dy, dx) for dy in (-REACH_PX, 0, REACH_PX) for dx in (-REACH_PX, 0, REACH_PX)]
    reached = np.concatenate([np.concatenate([across, along]) + step for step in steps])
    inside = (reached >= 0).all(axis=1) & (reached < (ny, nx)).all(axis=1)
    corners = np.unique(reached[inside] // SQUARE_PX, axis=0) * SQUARE_PX
    return [Window(x, y, min(x + SQUARE_PX, nx), min(y + SQUARE_PX, ny)) for y, x in corners.tolist()]


def render_positions(
    pose: Pose, camera: Camera, target: Target, window: Window, oversample: int
) -> NDArray[np.float32]:
    """Body-fixed surface points (ny*s, nx*s, 3), in units of the mean radius, seen through the centres of an s x s
    grid of sub-pixels of `window`; zero where the ray misses."""
    return rendered(_scene(pose, camera, target, window, oversample))[..., -3:]


def _scene(pose: Pose, camera: Camera, target: Target, window: Window, oversample: int) -> Any:
    """The target and its camera, whose film is the window.

    Mitsuba works in single precision: the target sits at the origin in units of its radius. The film is the window
    itself, its optical axis placed by the principal point, so that only the crop is rendered.
    """
    mi = mitsuba()
    ny, nx = window.shape
    unit = target.mean_radius_km
    distance = pose.range_km / unit
    # Mitsuba looks along +Z with +X to the left of the film and +Y up: turn our +X right, +Y down about the boresight.
    body_from_camera = pose.camera_from_body.T @ np.diag([-1.0, -1.0, 1.0])
    to_world = np.eye(4)
    to_world[:3, :3] = body_from_camera
    to_world[:3, 3] = pose.spacecraft_in_body_km / unit
    axis_x = camera.centre_px[0] - (window.x0 + window.x1 - 1) / 2
    axis_y = camera.centre_px[1] - (window.y0 + window.y1 - 1) / 2
    reach = 1.05 * max(target.radii_km) / unit
    transform = mi.ScalarTransform4f
    return mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "aov", "aovs": "p:position"},
            "sensor": {
                "type": "perspective",
                "fov_axis": "x",
                "fov": float(np.degrees(2 * np.arctan(nx / 2 / camera.focal_length_px))),
                "to_world": transform(to_world.tolist()),
                "near_clip": max(distance - reach, 1e-3) * 0.5,
                "far_clip": (distance + reach) * 2,
                "principal_point_offset_x": float(-axis_x / nx),
                "principal_point_offset_y": float(-axis_y / ny),
                "film": {
                    "type": "hdrfilm",
                    "width": nx * oversample,
                    "height": ny * oversample,
                    "rfilter": {"type": "box"},
                    "pixel_format": "rgb",
                    "component_format": "float32",
                },
                "sampler": {"type": "stratified", "sample_count": 1, "jitter": False},
            },
            "unit_sphere": {"type": "shapegroup", "sphere": {"type": "sphere"}},
            # A sphere scaled by different factors is rendered wrongly; an instance of one is right.
            "ellipsoid": {
                "type": "instance",
                "shapes": {"type": "ref", "id": "unit_sphere"},
                "to_world": transform().scale([r / unit for r in target.radii_km]),
            },
        }
    )
