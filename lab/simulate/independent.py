"""Pictures of one body by a renderer that shares no code with the estimator's: ray caster, photometric laws, optics and
map lookup of the honesty benchmark. Truth that is planted in tests and benchmarks is drawn here.

Nothing here imports `tasks`, and what is imported does not either (`tests/test_house.py`).
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from catalog.basemap import BaseMap, map_of_target
from catalog.camera import Camera
from catalog.pose import Pose
from catalog.target import Target
from lab.honesty.caster import View, render
from lab.honesty.optics import Blur, blurred
from lab.honesty.solids import Solid

# How far around disk and frame rays are cast: what blur brings in from there.
MARGIN_PX = 12
# Rays along a pixel's side; a number that the corrections never use.
OVERSAMPLE = 7
# The law of the joint step's usual scene, by its name here.
LUNAR_LAMBERT = {"lunar-lambert": 1.0}


def independent_image(
    camera: Camera,
    target: Target,
    pose: Pose,
    laws: Mapping[str, float] = LUNAR_LAMBERT,
    basemap: BaseMap | None = None,
    psf_sigma_px: float | None = None,
    oversample: int = OVERSAMPLE,
) -> NDArray[np.float64]:
    """Brightness (ny, nx) of what an ideal camera, without distortion, sees of the target alone at `pose`, before a
    black sky: relative to its 99th percentile over the disk's square, as far as that is near the frame.

    laws: names of `lab.honesty.laws`, each with its weight. basemap: None is the target's own map. psf_sigma_px: of the
    Gaussian blur; None is the camera's. oversample: rays along a pixel's side.

    Raises as `lab.honesty.laws.radiance` and `map_of_target`.
    """
    basemap = map_of_target(target) if basemap is None else basemap
    nx, ny = camera.size_px
    frame = np.zeros((ny, nx))
    x, y = (float(each) for each in camera.project(pose.target_in_camera_km))
    reach = int(np.ceil(camera.focal_length_px * max(target.radii_km) / pose.range_km)) + MARGIN_PX
    x0, y0 = max(round(x) - reach, -MARGIN_PX), max(round(y) - reach, -MARGIN_PX)
    x1, y1 = min(round(x) + reach, nx - 1 + MARGIN_PX) + 1, min(round(y) + reach, ny - 1 + MARGIN_PX) + 1
    if x1 <= x0 or y1 <= y0:
        return frame
    view = View(pose.camera_from_j2000, camera.focal_length_px, camera.centre_px, x0, y0, x1 - x0, y1 - y0, oversample)
    map_from_body = Rotation.from_euler("z", -basemap.left_edge_deg, degrees=True).as_matrix()
    sun = pose.sun_from_target_km / np.linalg.norm(pose.sun_from_target_km)
    fine = np.zeros(((y1 - y0) * oversample, (x1 - x0) * oversample), np.float32)
    for law, weight in laws.items():
        solid = Solid(
            pose.target_from_spacecraft_km,
            np.asarray(target.radii_km),
            pose.body_from_j2000,
            law,
            texture=basemap.albedo,
            map_from_body=np.asarray(map_from_body),
        )
        fine += np.float32(weight) * render(view, [solid], sun)
    bright = blurred(fine, Blur(camera.psf_sigma_px if psf_sigma_px is None else psf_sigma_px), oversample)
    level = float(np.percentile(bright, 99))
    top, left, bottom, right = max(y0, 0), max(x0, 0), min(y1, ny), min(x1, nx)
    frame[top:bottom, left:right] = bright[top - y0 : bottom - y0, left - x0 : right - x0]
    return frame / level if level > 0 else frame
