"""A small product whose pixels are what its pose says: a Lambert disk of 60 px radius, for tests of stores."""

from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from scipy.spatial.transform import Rotation

from catalog.camera import Camera
from catalog.observation import Observation
from catalog.pose import Pose
from catalog.target import Target
from tasks.project.planes import project_planes
from tasks.project.uncertainty import PoseUncertainty
from tasks.publish import Publication
from tasks.publish.cube import write_group
from tasks.publish.plain_cube import compressor
from tasks.publish.variables import BY_NAME

EUROPA = Target(
    name="europa", naif_id=502, radii_km=(1562.6, 1560.3, 1559.5), body_frame="IAU_EUROPA", iau_crs="IAU_2015:50200"
)
SIGMAS = {"offset_px": [0.1, 0.2], "range_factor": 1e-4, "attitude_deg": [0.1, 0.1, 0.2]}
PROVENANCE = {"image": {"sha256": "ab12"}, "kernels": [["pck00010.tpc", "cd34"]]}


def camera_of(size: int) -> Camera:
    """A square pinhole whose boresight falls on the middle."""
    return Camera(name="test", size_px=(size, size), centre_px=((size - 1) / 2,) * 2, focal_length_px=2e4)


def pose_of(radius_px: float, body_from_camera_deg: tuple[float, float] = (75.0, 20.0)) -> Pose:
    """Target ahead, Sun to the right and behind the camera; the body turned about x and z."""
    body = Rotation.from_euler("xz", body_from_camera_deg, degrees=True).as_matrix()
    return Pose(1.2e7, np.eye(3), np.array([300.0, -200.0, 1560 * 2e4 / radius_px]), np.array([6e8, 1e8, -4e8]), body)


def small_publication(product: str = "C0001", size: int = 160, radius_px: float = 60.0, **changes: Any) -> Publication:
    """Image, poses and papers of a small product; `changes` replace fields."""
    camera, after = camera_of(size), changes.pop("pose_after", None) or pose_of(radius_px)
    lambert = np.cos(np.radians(project_planes(after, camera, EUROPA, planes=("incidence",)).incidence))
    noise = np.random.default_rng(2).normal(0, 5, (size, size))
    image = (1000 * np.clip(np.nan_to_num(lambert), 0, None) + noise).astype(np.float32)
    given: dict[str, Any] = {
        "product": product,
        "observation": Observation(image, np.full_like(image, 5), np.zeros(image.shape, np.uint16)),
        "camera": camera,
        "target": EUROPA,
        "pose_before": after.with_range_factor(1.01),
        "pose_after": after,
        "uncertainty": PoseUncertainty.from_sigmas(SIGMAS),
        "result": {"product": product, "status": "ok", "range_factor": 0.9995, "limb_rms_px": 0.31},
        "settings": {"profile": "paper"},
        "provenance": PROVENANCE,
    }
    return Publication(**{**given, **changes})


def write_cube(cube: xr.Dataset, path: Path) -> None:
    """A cube by xarray, encoded as products' cubes are: the reference of the program's own writer."""
    encoding: dict[str, dict[str, Any]] = {
        name: {"chunks": cube[name].shape, "compressors": [compressor()]} for name in BY_NAME if name in cube
    }
    encoding["quality"]["_FillValue"] = None
    write_group(cube, path, encoding)
