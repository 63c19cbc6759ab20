"""A small image of Europa by a camera that no catalog knows, with a pose file that is wrong by some pixels."""

from pathlib import Path

import numpy as np
from PIL import Image

from catalog.camera import read_camera_file
from catalog.pose import Pose, write_pose_file
from catalog.rotation import rotation_from_vector_deg
from catalog.target import find_target
from lab.simulate.independent import independent_image

CAMERA = 'name = "small"\nsize_px = [112, 104]\ncentre_px = [55.5, 51.5]\nfocal_length_px = 20000\npsf_sigma_px = 0.8\n'
PROFILE = 'base = "defaults"\npasses = 1\n[simulate]\noversample = 2\n'
TRUE_CENTRE_PX = (55.5, 51.5)
PLANTED_OFFSET_PX = (5.236, 6.982)


def write_small_archive(folder: Path) -> None:
    """small.png (16 bit), small.toml, pose.json (wrong), quick.toml (a profile) in `folder`."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "small.toml").write_text(CAMERA)
    (folder / "quick.toml").write_text(PROFILE)
    camera, target = read_camera_file(folder / "small.toml"), find_target("europa")
    truth = Pose(
        et=0.0,
        camera_from_j2000=np.eye(3),
        target_from_spacecraft_km=np.array([0.0, 0.0, 780_000.0]),
        sun_from_target_km=np.array([-4e8, 1e8, -5e8]),
        body_from_j2000=rotation_from_vector_deg([20, 30, 40]),
    )
    clean = independent_image(camera, target, truth)
    noisy = 1000 + 50_000 * clean / clean.max() + np.random.default_rng(0).normal(0, 150, clean.shape)
    Image.fromarray(np.clip(noisy, 0, 65535).astype(np.uint16)).save(folder / "small.png")
    wrong = truth.replaced(camera_from_j2000=rotation_from_vector_deg([0.02, -0.015, 0]))
    write_pose_file(wrong, folder / "pose.json")
