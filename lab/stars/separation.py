"""Frames of a lit body among stars, with an error of the camera and another of the target's place planted apart: the
body by the ray caster of `lab.honesty`, the stars by `lab.stars.frame`."""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera
from catalog.pose import Pose, write_pose_file
from catalog.rotation import rotation_from_vector_deg
from catalog.target import find_target
from lab.honesty.caster import View, render
from lab.honesty.solids import Solid, packaged_texture
from lab.stars.frame import READ_NOISE, SKY, height_of, places_of, star_picture
from lab.stars.sky import made_up_sky, seen_directions

Array = NDArray[np.float64]
OVERSAMPLE = 4
PEAK = 1500.0
STARS_IN_FRAME = 35.0
YEAR = 2006.3


@dataclass(frozen=True)
class Planted:
    """A scene's truth. pose: the true one. offset_km: (3,) J2000, target less predicted target. files: image, camera,
    pose file and star catalog."""

    camera: Camera
    pose: Pose
    offset_km: Array
    files: dict[str, Path]


def write_separation_scene(
    folder: Path, seed: int, size_px: tuple[int, int] = (300, 280), radius_px: float = 36.0
) -> Planted:
    """Europa of `radius_px` with stars around; the predicted camera is off by about ten pixels and a twentieth of a
    degree, and the target by 1 to 50 km in any direction."""
    from astropy.io import fits

    random = np.random.default_rng(seed)
    target, range_km = find_target("europa"), 1.2e6
    focal_px = radius_px * range_km / target.mean_radius_km
    centre = ((size_px[0] - 1) / 2, (size_px[1] - 1) / 2)
    camera = Camera(
        name="among-stars", size_px=size_px, centre_px=centre, focal_length_px=focal_px, focal_length_sigma=0.0,
        psf_sigma_px=0.9,
    )  # fmt: skip
    camera_from_j2000, body = (rotation_from_vector_deg(random.uniform(-180, 180, 3)) for _ in range(2))
    sight = camera.ray(np.array(centre) + random.uniform(-50, 50, 2))
    side = np.cross(sight, random.normal(0, 1, 3))
    phase = np.radians(random.uniform(25, 75))
    sun = -np.cos(phase) * sight + np.sin(phase) * side / np.linalg.norm(side)
    velocity = random.normal(0, 15.0, 3)
    pose = Pose(
        (YEAR - 2000.0) * 365.25 * 86400.0, camera_from_j2000, camera_from_j2000.T @ sight * range_km,
        camera_from_j2000.T @ sun * 7.8e8, body, velocity, np.zeros(3),
    )  # fmt: skip
    picture = _disk(camera, pose) + _stars(camera, pose, folder, random)
    noise = random.normal(0, 1, picture.shape) * np.sqrt(READ_NOISE**2 + np.maximum(picture, 0) / 40)
    direction = random.normal(0, 1, 3)
    offset_km = random.uniform(1, 50) * direction / np.linalg.norm(direction)
    off_deg = np.append(np.degrees(10.0 / focal_px) * random.normal(0, 1, 2), 0.05 * random.normal())
    predicted = pose.replaced(
        camera_from_j2000=rotation_from_vector_deg(off_deg) @ camera_from_j2000,
        target_from_spacecraft_km=pose.target_from_spacecraft_km - offset_km,
    )
    files = {"image": folder / "stars.fits", "camera": folder / "camera.toml", "pose": folder / "pose.json"}
    fits.writeto(files["image"], (picture + SKY + noise).astype(np.float32))
    files["camera"].write_text(camera.to_toml())
    write_pose_file(predicted, files["pose"])
    (folder / "truth.json").write_text(json.dumps({"pose": pose.to_dict(), "offset_km": offset_km.tolist()}))
    return Planted(camera, pose, offset_km, files | {"catalog": folder / "sky.parquet"})


def _disk(camera: Camera, pose: Pose) -> Array:
    """Light (ny, nx) of the body, blurred as the camera does."""
    from scipy.ndimage import gaussian_filter

    target = find_target("europa")
    solid = Solid(
        pose.target_from_spacecraft_km, np.asarray(target.radii_km), pose.body_from_j2000, "lunar-lambert",
        {}, packaged_texture(str(target.basemap)),
    )  # fmt: skip
    nx, ny = camera.size_px
    view = View(pose.camera_from_j2000, camera.focal_length_px, camera.centre_px, 0, 0, nx, ny, OVERSAMPLE)
    fine = render(view, [solid], pose.sun_from_target_km / np.linalg.norm(pose.sun_from_target_km))
    fine = gaussian_filter(fine, camera.psf_sigma_px * OVERSAMPLE)
    light = fine.reshape(ny, OVERSAMPLE, nx, OVERSAMPLE).mean(axis=(1, 3)).astype(np.float64)
    return np.asarray(PEAK * light / light.max())


def _stars(camera: Camera, pose: Pose, folder: Path, random: np.random.Generator) -> Array:
    """Light (ny, nx) of the stars that the body does not hide; the catalog goes into a file."""
    import pandas as pd

    degrees = np.degrees(np.array(camera.size_px) / camera.focal_length_px)
    axis = pose.camera_from_j2000[2]
    sky = made_up_sky(axis, float(3 * degrees.max()), STARS_IN_FRAME / float(np.prod(degrees)), random)
    table = sky.table
    columns = {"ra": table.ra_deg, "dec": table.dec_deg, "mag": table.magnitude, "epoch": table.epoch}
    motions = {"pmra": table.pm_ra_mas, "pmdec": table.pm_dec_mas}
    pd.DataFrame(columns | motions).to_parquet(folder / "sky.parquet", index=False)
    directions = seen_directions(table, YEAR, np.asarray(pose.spacecraft_velocity_km_s))
    to_target = pose.target_from_spacecraft_km / pose.range_km
    hidden = directions @ to_target > np.cos(1.0 * find_target("europa").mean_radius_km / pose.range_km)
    signal = np.minimum(5.0 * 10 ** (0.4 * (12.0 - table.magnitude)), 400.0)
    heights = np.array([height_of(each, camera.psf_sigma_px) for each in signal])
    places = places_of(camera, pose.camera_from_j2000, directions)
    shown = np.isfinite(places).all(axis=1) & ~hidden
    return star_picture(camera.size_px[::-1], places[shown], heights[shown], camera.psf_sigma_px)
