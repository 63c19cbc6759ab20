"""Simulate an archive of images with planted errors, and the truth beside them."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from catalog.basemap import map_of_target
from catalog.camera import Camera, find_camera
from catalog.demo import DemoImage, demo
from catalog.observation import Observation
from catalog.pose import Pose, write_pose_file
from catalog.reseau import find_reseau_table
from catalog.target import Target, find_target
from tasks.publish.fits import write_fits
from tasks.simulate.detector import exposed, has_8_bits, raw_frame
from tasks.simulate.plant import planted
from tasks.simulate.scene import Scene
from tasks.undistort import DistortionModel, UndistortSettings, undistort

SKY_DN = 4.0


@dataclass(frozen=True)
class SimulatedImage:
    """Where an image of the archive is: FITS file, pose file with planted errors, pose file with the truth."""

    entry: DemoImage
    image: Path
    predicted: Path
    truth: Path


def simulate_archive(folder: Path, products: tuple[str, ...] | None = None) -> list[SimulatedImage]:
    """Write the demo's images (all, or some `products`) to `folder`: PRODUCT.fits in the camera's raw geometry, with
    noise, PSF and reseau marks; PRODUCT.predicted.json, wrong by the planted errors; PRODUCT.truth.json."""
    folder.mkdir(parents=True, exist_ok=True)
    target = find_target(demo().target)
    return [
        _simulate(folder, entry, target, seed)
        for seed, entry in enumerate(demo().images, demo().noise_seed)
        if products is None or entry.product in products
    ]


def _simulate(folder: Path, entry: DemoImage, target: Target, seed: int) -> SimulatedImage:
    camera = find_camera(entry.camera)
    simulated = SimulatedImage(
        entry, *(folder / f"{entry.product}.{suffix}" for suffix in ("fits", "predicted.json", "truth.json"))
    )
    scene = Scene(camera, target, map_of_target(target))
    frame = raw_frame(scene, entry.pose, _distortion(camera), entry.peak_dn, SKY_DN)
    observation = exposed(frame, camera, np.random.default_rng(seed), _marks(camera))
    et = entry.pose.et
    write_fits(simulated.image, observation, camera.name, target.name, et, entry.exposure_s, has_8_bits(camera))
    write_pose_file(_predicted(entry, camera), simulated.predicted)
    write_pose_file(entry.pose, simulated.truth)
    return simulated


def _distortion(camera: Camera) -> DistortionModel:
    """The model that correcting the image will use too."""
    columns, rows = camera.detector_size_px
    empty = np.zeros((rows, columns), np.float32)
    nothing = Observation(empty, empty, empty.astype(np.uint16))
    return undistort(nothing, camera, UndistortSettings(space="sensor")).model


def _predicted(entry: DemoImage, camera: Camera) -> Pose:
    return planted(entry.pose, camera, entry.offset_px, entry.range_factor, entry.attitude_deg)


def _marks(camera: Camera) -> NDArray[np.float64] | None:
    table = camera.distortion.parameters.get("table")
    return find_reseau_table(table).raw_xy if table else None
