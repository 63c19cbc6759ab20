"""A small store of simulated images whose phase function is known: for the notebook, for tests, for trying a fit."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from catalog.basemap import uniform_map
from catalog.camera import Camera
from catalog.observation import Observation, Quality
from catalog.pose import Pose
from catalog.target import Target, find_target
from lab.simulate.randomness import SmoothField, generator
from tasks.photometry.laws import Values, find_law
from tasks.project.rays import intersect, rays_of
from tasks.project.uncertainty import PoseUncertainty
from tasks.publish import Publication, publish
from tasks.simulate.scene import detect

Array = NDArray[np.float64]
PHASES_DEG = (12.0, 25.0, 40.0, 55.0, 70.0, 85.0, 100.0)
OVERSAMPLE = 3
PSF_SIGMA_PX = 0.7
DISK_FILLS = 0.9  # of the frame
FOCAL_LENGTH_PX = 1e5
FRAMES_APART_S = 600.0
MOTTLES = (20.0, 60.0)  # radians per radius: features of 6 to 18 degrees
SIGMAS = {"offset_px": [0.05, 0.05], "range_factor": 1e-4, "attitude_deg": [0.1, 0.1, 0.1]}
EUROPA_HAPKE = {"w": 0.93, "b": -0.35, "c": 0.25, "theta_deg": 18.0, "b0": 0.5, "h": 0.0016}
EUROPA_LUNAR_LAMBERT = {"albedo": 2000.0, "mag_per_deg": 0.012, "limb_weight": 0.75, "limb_weight_per_deg": -0.005}


@dataclass(frozen=True)
class Planted:
    """law and parameters: of the surface; units_per_if: image units per I/F (1 for laws in the image's own unit);
    calibration: each image's true factor."""

    law: str
    parameters: dict[str, float]
    units_per_if: float
    calibration: dict[str, float]


def write_planted_store(
    store: Path,
    law: str = "hapke",
    parameters: Values | None = None,
    phases_deg: Sequence[float] = PHASES_DEG,
    size_px: int = 72,
    calibration_sigma: float = 0.03,
    mottling: float = 0.04,
    noise: float = 0.01,
    units_per_if: float = 4000.0,
    seed: int = 1,
) -> Planted:
    """Publish one small image of Europa per phase, with a uniform phase function and true geometry.

    The images are made as a camera would: the surface under sub-pixels, blurred, summed, with noise (relative to the
    brightest pixel), each with a calibration factor of its own. mottling: relative standard deviation of a smooth
    random albedo, the same ground in all images, that a fit does not know. Returns what was planted.
    """
    chosen = dict(parameters or (EUROPA_HAPKE if law == "hapke" else EUROPA_LUNAR_LAMBERT))
    target = find_target("europa")
    rng = generator(seed, "planted store", "calibration")
    field = SmoothField(generator(seed, "planted store", "albedo"), *MOTTLES)
    scale = 1.0 if find_law(law).scaled else units_per_if
    calibration = {}
    for number, phase_deg in enumerate(phases_deg):
        product = f"PHASE_{phase_deg:05.1f}"
        camera, pose = _camera(size_px), _pose(target, size_px, phase_deg, number)
        factor = float(np.exp(rng.normal(0, calibration_sigma)))
        clean = factor * scale * _picture(pose, camera, target, law, chosen, mottling, field)
        sigma = np.full_like(clean, noise * clean.max())
        observed = (clean + generator(seed, product, "noise").normal(0, sigma)).astype(np.float32)
        publish(_publication(product, observed, sigma, camera, target, pose), store)
        calibration[product] = factor
    return Planted(law, chosen, scale, calibration)


def _camera(size_px: int) -> Camera:
    middle = (size_px - 1) / 2
    return Camera(
        name="planted", size_px=(size_px, size_px), centre_px=(middle, middle),
        focal_length_px=FOCAL_LENGTH_PX, psf_sigma_px=PSF_SIGMA_PX,
    )  # fmt: skip


def _pose(target: Target, size_px: int, phase_deg: float, number: int) -> Pose:
    """Camera above the equator, 20 degrees of longitude from frame to frame; Sun `phase_deg` to the right."""
    range_km = 2 * target.mean_radius_km * FOCAL_LENGTH_PX / (DISK_FILLS * size_px)
    phase = np.radians(phase_deg)
    sun = 7.8e8 * np.array([np.sin(phase), 0.0, -np.cos(phase)])
    north_up = Rotation.from_euler("x", 90, degrees=True)
    body = Rotation.from_euler("z", 20.0 * number, degrees=True) * north_up
    return Pose(FRAMES_APART_S * number, np.eye(3), np.array([0.0, 0.0, range_km]), sun, body.as_matrix())


def _picture(
    pose: Pose, camera: Camera, target: Target, law: str, values: Values, mottling: float, field: SmoothField
) -> NDArray[np.float32]:
    """Brightness (ny, nx) as the camera sees it."""
    nx, ny = camera.size_px
    x, y = ((np.arange(n * OVERSAMPLE) + 0.5) / OVERSAMPLE - 0.5 for n in (nx, ny))
    scaled = intersect(rays_of(pose, camera, target), np.stack(np.meshgrid(x, y), axis=-1))
    hit = np.isfinite(scaled[..., 0])
    radii = np.asarray(target.radii_km)
    place = scaled[hit] * radii
    normal = _unit(scaled[hit] / radii)
    to_camera = _unit(pose.spacecraft_in_body_km - place)
    sun = pose.sun_direction_in_body
    mu0, mu = normal @ sun, (normal * to_camera).sum(axis=-1)
    phase_deg = np.degrees(np.arccos(np.clip(to_camera @ sun, -1, 1)))
    lit = (mu0 > 0) & (mu > 0)
    bright = np.zeros(len(place))
    bright[lit] = find_law(law).reflectance(values, mu0[lit], mu[lit], phase_deg[lit])
    fine = np.zeros(hit.shape, np.float32)
    fine[hit] = bright * (1 + mottling * field(_unit(place)))
    return detect(fine, OVERSAMPLE, PSF_SIGMA_PX)


def _unit(vectors: Array) -> Array:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def _publication(
    product: str, image: NDArray[np.float32], noise: Array, camera: Camera, target: Target, pose: Pose
) -> Publication:
    quality = np.zeros(image.shape, np.uint16)
    quality[0, :] |= np.uint16(Quality.MISSING)  # as frames have it
    result = {
        "product": product, "status": "ok", "reason": None, "camera": camera.name, "target": target.name,
        "offset_px": [0.0, 0.0], "range_factor": 1.0, "attitude_deg": [0.0, 0.0, 0.0],
    }  # fmt: skip
    basemap = {"name": uniform_map().name, "sha256": uniform_map().sha256}
    return Publication(
        product=product,
        observation=Observation(image, noise.astype(np.float32), quality),
        camera=camera,
        target=target,
        pose_before=pose,
        pose_after=pose,
        uncertainty=PoseUncertainty.from_sigmas(SIGMAS),
        result=result,
        settings={"profile": "planted"},
        provenance={"image": {"sha256": "simulated"}, "kernels": [], "basemap": basemap},
    )
