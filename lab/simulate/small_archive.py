"""An archive of many small images of Europa, quick to make and to correct: for benchmarks of the orchestration."""

import csv
from pathlib import Path

import numpy as np

from catalog.camera import read_camera_file
from catalog.pose import Pose, write_pose_file
from catalog.rotation import rotation_from_vector_deg
from catalog.target import find_target
from lab.simulate.independent import independent_image

CAMERA = """name = "small"
size_px = [72, 64]
centre_px = [35.5, 31.5]
focal_length_px = 10000
psf_sigma_px = 0.8
"""
PROFILE = """base = "defaults"
passes = 1
steps = ["point"]
[simulate]
oversample = 2
[accept]
min_likeness = 0.3
sure_likeness = 0.4
"""
LIST, PROFILE_FILE = "images.csv", "small.toml"
CAMERA_FILE, POSE_FILE = "camera.toml", "pose.json"
PEAK_DN, SKY_DN, NOISE_DN = 50_000.0, 1000.0, 150.0


def write_small_archive(folder: Path, count: int, seed: int = 0) -> Path:
    """Write `count` images, which differ in noise alone, their camera, a pose that is wrong by some pixels, the profile
    `small.toml`, and the list of them, whose path is returned."""
    from PIL import Image

    folder.mkdir(parents=True, exist_ok=True)
    (folder / CAMERA_FILE).write_text(CAMERA)
    (folder / PROFILE_FILE).write_text(PROFILE)
    truth = true_pose()
    clean = clean_image(folder / CAMERA_FILE, truth)
    random = np.random.default_rng(seed)
    names = [f"small-{number:05d}" for number in range(count)]
    for name in names:
        noisy = clean + random.normal(0, NOISE_DN, clean.shape)
        Image.fromarray(np.clip(noisy, 0, 65535).astype(np.uint16)).save(folder / f"{name}.png")
    write_pose_file(truth.replaced(camera_from_j2000=rotation_from_vector_deg([0.02, -0.015, 0])), folder / POSE_FILE)
    with (folder / LIST).open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(("product", "image", "camera", "target", "pose_file"))
        writer.writerows((name, f"{name}.png", CAMERA_FILE, "europa", POSE_FILE) for name in names)
    return folder / LIST


def true_pose() -> Pose:
    """Europa some forty pixels wide, at a phase angle of about forty degrees."""
    return Pose(
        et=0.0,
        camera_from_j2000=np.eye(3),
        target_from_spacecraft_km=np.array([0.0, 0.0, 780_000.0]),
        sun_from_target_km=np.array([-4e8, 1e8, -5e8]),
        body_from_j2000=rotation_from_vector_deg([20, 30, 40]),
    )


def clean_image(camera_file: Path, pose: Pose) -> "np.ndarray[tuple[int, ...], np.dtype[np.float64]]":
    """The image without noise (ny, nx), DN."""
    clean = independent_image(read_camera_file(camera_file), find_target("europa"), pose)
    return np.asarray(SKY_DN + PEAK_DN * clean / clean.max(), dtype=np.float64)
