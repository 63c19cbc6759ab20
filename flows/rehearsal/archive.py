"""A list of small simulated images of Europa, by a camera of their own: each is corrected within seconds."""

import csv
from pathlib import Path

import numpy as np

from catalog.basemap import map_of_target
from catalog.camera import read_camera_file
from catalog.pose import Pose, write_pose_file
from catalog.rotation import rotation_from_vector_deg
from catalog.target import find_target

CAMERA = 'name = "small"\nsize_px = [112, 104]\ncentre_px = [55.5, 51.5]\nfocal_length_px = 20000\npsf_sigma_px = 0.8\n'
PROFILE = 'passes = 1\nsteps = ["point", "range", "attitude"]\n[simulate]\noversample = 2\n'
LIST, PROFILE_FILE = "images.csv", "quick.toml"
LARGEST_OFFSET_DEG = 0.02  # about 7 px


def write_archive(folder: Path, count: int, seed: int = 1) -> Path:
    """`count` images, their pose files (wrong by up to 7 px), a profile `quick.toml`, and `images.csv`, whose path is
    returned. The same seed makes the same bytes."""
    from PIL import Image

    from tasks.simulate import Scene
    from tasks.simulate.window import Window

    folder.mkdir(parents=True, exist_ok=True)
    (folder / "small.toml").write_text(CAMERA)
    (folder / PROFILE_FILE).write_text(PROFILE)
    camera, target = read_camera_file(folder / "small.toml"), find_target("europa")
    scene, rng = Scene(camera, target, map_of_target(target)), np.random.default_rng(seed)
    rows = []
    for number in range(count):
        product = f"small{number:05d}"
        truth = _truth(number, count)
        clean = scene.render(truth, Window(0, 0, *camera.size_px)).image()
        noisy = 1000 + 50_000 * clean / clean.max() + rng.normal(0, 150, clean.shape)
        Image.fromarray(np.clip(noisy, 0, 65535).astype(np.uint16)).save(folder / f"{product}.png")
        wrong = rotation_from_vector_deg([*rng.uniform(-LARGEST_OFFSET_DEG, LARGEST_OFFSET_DEG, 2), 0])
        write_pose_file(truth.replaced(camera_from_j2000=wrong), folder / f"{product}.json")
        rows.append([product, f"{product}.png", "small.toml", "europa", f"{product}.json"])
    with (folder / LIST).open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([["product", "image", "camera", "target", "pose_file"], *rows])
    return folder / LIST


def _truth(number: int, count: int) -> Pose:
    """The body turns once while the images are taken, a minute apart."""
    return Pose(
        et=60.0 * number,
        camera_from_j2000=np.eye(3),
        target_from_spacecraft_km=np.array([0.0, 0.0, 780_000.0]),
        sun_from_target_km=np.array([-4e8, 1e8, -5e8]),
        body_from_j2000=rotation_from_vector_deg([0, 0, 360 * number / count]) @ rotation_from_vector_deg([20, 30, 40]),
    )
