"""How long every step of a profile takes on one core, of an image that is rendered or of a real one."""

import json
import os
import resource
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from catalog.camera import Camera, find_camera
from catalog.errors import RefusedError
from catalog.pose import Pose, write_pose_file
from catalog.reasons import Reason
from catalog.rotation import rotation_from_vector_deg
from catalog.settings import data_folder
from catalog.target import Target, find_target
from flows.one_image import one_result
from flows.progress import Silent
from flows.request import Request
from lab.paper.real_images import REAL_IMAGES
from lab.paper.section import NO_DATA
from lab.simulate.independent import independent_image
from lab.simulate.plant import planted
from tasks.attitude.flow import optical_flow
from tasks.profile import find_profile
from tasks.step import run

CAMERA, TARGET = "newhorizons-lorri", "europa"
# Diameter in pixels of the rendered disks, in a frame of 1024 x 1024.
DISKS = {"disk-224": 224.0, "disk-900": 900.0}
REAL = {"galileo": "C0552809300R", "io": "f1636832"}
IMAGES = (*DISKS, *REAL)
OFFSET_PX, RANGE_FACTOR, ATTITUDE_DEG = (16.5, 9.4), 0.997, (0.5, -0.4, 0.6)
# Rays along a pixel's side: a disk of 900 px needs no more.
RAYS = 3
PEAK_DN, SKY_DN, NOISE_DN = 3000.0, 60.0, 15.0
# Processor seconds of a warm image by profile; where nobody set one there is none.
BARS_S = {
    "paper": {"disk-224": 15.0},
    "joint": {"disk-224": 1.3, "disk-900": 2.8, "galileo": 1.7, "io": 7.0},
}
FLOW_BAR_S = 1.0


def benchmark_steps(
    profile: str = "paper", image: str = "disk-224", repeat: int = 1, flow_size: int = 1024
) -> dict[str, Any]:
    """Seconds of every step from the file to the cube, without cache, without Prefect, and on one core where the system
    lets a process be held there; and of the optical flow of two frames of flow_size x flow_size pixels.

    image: one of IMAGES; a disk is rendered with planted errors of the paper's mean size. first_s: of a first run,
    which also loads libraries and compiles; total_s: of a later one, without its cache; total_cpu_s: what the
    processor worked on it, the median of `repeat` runs, which is what total_s is on a machine with nothing else to do,
    and is held against total_bar_s (where there is one). peak_mb: of the process, so far.

    Raises RefusedError for a real image where there are no real mission files.
    """
    with TemporaryDirectory() as name, one_core() as held:
        folder = Path(name)
        given = real_image(folder, image) if image in REAL else rendered_disk(folder, DISKS[image])
        first_s, _, _ = correct(folder, profile, "first", given)
        runs = [correct(folder, profile, f"later-{number}", given) for number in range(repeat)]
        flow_s = flow_seconds(flow_size)
    total_s, cpu_s = (float(np.median([each[k] for each in runs])) for k in (0, 1))
    result = runs[-1][2]
    return {
        "profile": profile,
        "image": image,
        "on_one_core": held,
        "status": result["status"],
        "reason": result["reason"],
        "limb_rms_px": result["limb_rms_px"],
        "steps_s": result["seconds"],
        "total_s": round(total_s, 3),
        "total_cpu_s": round(cpu_s, 3),
        "total_bar_s": BARS_S.get(find_profile(profile).name, {}).get(image),
        "runs": repeat,
        "first_s": round(first_s, 3),
        "peak_mb": round(peak_mb()),
        "flow_size_px": flow_size,
        "flow_s": round(flow_s, 3),
        "flow_bar_s": FLOW_BAR_S,
    }


def rendered_disk(folder: Path, diameter_px: float) -> dict[str, Any]:
    """A picture of a disk and what a request says of it."""
    camera, target = find_camera(CAMERA), find_target(TARGET)
    truth = true_pose(camera, target, diameter_px)
    write_image(folder / "disk.png", camera, target, truth)
    write_pose_file(planted(truth, camera, OFFSET_PX, RANGE_FACTOR, ATTITUDE_DEG), folder / "disk.json")
    image, pose_file = folder / "disk.png", folder / "disk.json"
    return {"image": image, "camera": CAMERA, "target": TARGET, "pose_file": pose_file, "kernels": ()}


def real_image(folder: Path, name: str) -> dict[str, Any]:
    """The same for a real image. Raises RefusedError where its file is not there."""
    real, data = REAL_IMAGES[REAL[name]], data_folder()
    if data is None or not (data / "images" / real.file).is_file():
        raise RefusedError(Reason.NO_IMAGES, f"{NO_DATA}.", f"Or measure another: {', '.join(DISKS)}.")
    given: dict[str, Any] = {"image": data / "images" / real.file, "target": real.target}
    given["kernels"] = (data / "kernels",) if real.kernels else ()
    if parts := real.pose_parts():
        (folder / "pose.json").write_text(json.dumps(parts))
        given["pose_file"] = folder / "pose.json"
    return given


def peak_mb() -> float:
    """The most memory that this process has held, MB."""
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return most / 1e6 if sys.platform == "darwin" else most * 1024 / 1e6


def true_pose(camera: Camera, target: Target, diameter_px: float) -> Pose:
    """The target diameter_px wide, off the frame's middle, at a phase angle of about 45 degrees."""
    range_km = 2 * target.mean_radius_km * camera.focal_length_px / diameter_px
    sight = camera.ray((470.3, 540.8)) * range_km
    return Pose(0.0, np.eye(3), sight, np.array([-5e8, 1.5e8, -5e8]), rotation_from_vector_deg([20, 30, 40]))


def write_image(path: Path, camera: Camera, target: Target, pose: Pose) -> None:
    """A 16-bit picture with noise."""
    from PIL import Image

    clean = independent_image(camera, target, pose, oversample=RAYS)
    noisy = SKY_DN + PEAK_DN * clean / clean.max() + np.random.default_rng(0).normal(0, NOISE_DN, clean.shape)
    Image.fromarray(np.clip(noisy, 0, 65535).astype(np.uint16)).save(path)


def correct(folder: Path, profile: str, attempt: str, given: dict[str, Any]) -> tuple[float, float, dict[str, Any]]:
    """Seconds of a run from the file to the cube, by the clock and of the processor, and its result."""
    request = Request(store=folder / attempt, profile=find_profile(profile), cache=folder / f"cache-{attempt}", **given)
    started, busy = time.perf_counter(), time.process_time()
    result = one_result(request, Silent(), run_step=run)
    return time.perf_counter() - started, time.process_time() - busy, result


def flow_seconds(size: int) -> float:
    """Best of three: flow of two textured frames by the paper's boxes."""
    from scipy.ndimage import gaussian_filter

    texture = gaussian_filter(np.random.default_rng(0).normal(size=(size, size)), 2).astype(np.float32)
    moved, usable = np.roll(texture, 2, axis=1), np.ones(texture.shape, bool)
    seconds = []
    for _ in range(3):
        started = time.perf_counter()
        optical_flow(moved, texture, usable)
        seconds.append(time.perf_counter() - started)
    return min(seconds)


@contextmanager
def one_core() -> Iterator[bool]:
    """Hold this process on one core within the `with` block, where the system can; whether it can."""
    if not hasattr(os, "sched_setaffinity"):
        yield False
        return
    cores = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(cores)})
    try:
        yield True
    finally:
        os.sched_setaffinity(0, cores)
