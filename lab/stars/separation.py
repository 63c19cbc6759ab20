"""Frames of a lit body among stars, with an error of the camera and another of the target's place planted apart: the
body by the ray caster of `lab.honesty`, the stars by `lab.stars.frame`."""

import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera
from catalog.pose import Pose, write_pose_file
from catalog.rotation import rotation_from_vector_deg
from catalog.target import find_target
from lab.honesty.caster import View, render
from lab.honesty.solids import Solid, packaged_texture, random_relief, with_map_errors
from lab.stars.frame import READ_NOISE, SKY, height_of, places_of, star_picture
from lab.stars.sky import SPEED_OF_LIGHT_KM_S, made_up_sky, seen_directions

Array = NDArray[np.float64]
OVERSAMPLE = 4
PEAK = 1500.0
STARS_IN_FRAME = 35.0
YEAR = 2006.3
# As in the honesty benchmark: laws, errors of the map's albedo and of its coordinates.
SURFACES: tuple[tuple[str, dict[str, float]], ...] = (
    ("lambert", {}), ("lommel-seeliger", {}), ("lunar-lambert", {}), ("minnaert", {"k": 0.7}), ("akimov", {}),
    ("hapke", {"w": 0.9, "b": -0.3, "b0": 0.5, "h": 0.05, "roughness_deg": 15.0}),
)  # fmt: skip
MAP_NOISE, MAP_FRAME_DEG, GRAINS = 0.03, 0.1, 4


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
    """A sequence of one frame, see `write_separation_sequence`."""
    return write_separation_sequence(folder, seed, 1, size_px, radius_px)[0]


def write_separation_sequence(
    folder: Path,
    seed: int,
    count: int,
    size_px: tuple[int, int] = (300, 280),
    radius_px: float = 36.0,
    as_mapped: bool = True,
    like: Camera | None = None,
) -> list[Planted]:
    """`count` frames of Europa of `radius_px` with stars around, 40 s apart; the predicted camera of each is off by
    about ten pixels and a twentieth of a degree, and the target of all by the same 1 to 50 km in any direction.

    like: the camera whose focal length and blur these frames have, without its distortion; by default one that sees
    Europa so large from 1.2 million km.

    as_mapped: the surface is as its map has it; otherwise it has one of six laws, the relief that Europa has, and a map
    with errors (albedo to 3 %, coordinates to 0.1 deg). Files are numbered where there are several frames."""
    random = np.random.default_rng(seed)
    target, range_km = find_target("europa"), 1.2e6
    focal_px = radius_px * range_km / target.mean_radius_km
    if like is not None:
        focal_px = like.focal_length_px
        range_km = focal_px * target.mean_radius_km / radius_px
    centre = ((size_px[0] - 1) / 2, (size_px[1] - 1) / 2)
    camera = Camera(
        name="among-stars", size_px=size_px, centre_px=centre, focal_length_px=focal_px, focal_length_sigma=0.0,
        psf_sigma_px=0.9 if like is None else like.psf_sigma_px,
    )  # fmt: skip
    camera_from_j2000 = rotation_from_vector_deg(random.uniform(-180, 180, 3))
    et = (YEAR - 2000.0) * 365.25 * 86400.0
    if target.rotation is None:
        raise ValueError("Europa's rotation is not known")
    body = target.rotation.body_from_j2000(et - range_km / SPEED_OF_LIGHT_KM_S)
    sight = camera.ray(np.array(centre) + random.uniform(-50, 50, 2))
    side = np.cross(sight, random.normal(0, 1, 3))
    phase = np.radians(random.uniform(25, 75))
    sun = -np.cos(phase) * sight + np.sin(phase) * side / np.linalg.norm(side)
    velocity = random.normal(0, 15.0, 3)
    first = Pose(
        et, camera_from_j2000, camera_from_j2000.T @ sight * range_km,
        camera_from_j2000.T @ sun * 7.8e8, body, velocity, np.zeros(3),
    )  # fmt: skip
    direction = random.normal(0, 1, 3)
    offset_km = random.uniform(1, 50) * direction / np.linalg.norm(direction)
    surface = _surface(as_mapped, random)
    return [
        _written(folder, "stars" if count == 1 else f"stars{number}", camera, pose, offset_km, surface, random)
        for number, pose in enumerate(_sequence(first, camera, count, random))
    ]


def _sequence(first: Pose, camera: Camera, count: int, random: np.random.Generator) -> Iterator[Pose]:
    """True poses: the camera looks some pixels elsewhere in each, the target stays where it is."""
    yield first
    for number in range(1, count):
        turn = np.append(np.degrees(20.0 / camera.focal_length_px) * random.normal(0, 1, 2), random.normal(0, 1.0))
        turned = rotation_from_vector_deg(turn) @ first.camera_from_j2000
        yield first.replaced(et=first.et + 40.0 * number, camera_from_j2000=turned)


def _written(
    folder: Path, name: str, camera: Camera, pose: Pose, offset_km: Array, surface: Solid, random: np.random.Generator
) -> Planted:
    """One frame, its camera, predicted pose and catalog as files in `folder`."""
    from astropy.io import fits

    catalog = folder / f"{name}.sky.parquet"
    picture = _disk(camera, pose, surface) + _stars(camera, pose, catalog, random)
    noise = random.normal(0, 1, picture.shape) * np.sqrt(READ_NOISE**2 + np.maximum(picture, 0) / 40)
    off_deg = np.append(np.degrees(10.0 / camera.focal_length_px) * random.normal(0, 1, 2), 0.05 * random.normal())
    predicted = pose.replaced(
        camera_from_j2000=rotation_from_vector_deg(off_deg) @ pose.camera_from_j2000,
        target_from_spacecraft_km=pose.target_from_spacecraft_km - offset_km,
    )
    files = {"image": folder / f"{name}.fits", "camera": folder / "camera.toml", "pose": folder / f"{name}.pose.json"}
    fits.writeto(files["image"], (picture + SKY + noise).astype(np.float32))
    files["camera"].write_text(camera.to_toml())
    write_pose_file(predicted, files["pose"])
    truth = {"pose": pose.to_dict(), "offset_km": offset_km.tolist()}
    (folder / f"{name}.truth.json").write_text(json.dumps(truth))
    return Planted(camera, pose, offset_km, files | {"catalog": catalog})


def _surface(as_mapped: bool, random: np.random.Generator) -> Solid:
    """Europa at no place yet."""
    target = find_target("europa")
    texture, radii = packaged_texture(str(target.basemap)), np.asarray(target.radii_km)
    nowhere = Solid(np.zeros(3), radii, np.eye(3), "lunar-lambert", {}, texture)
    if as_mapped:
        return nowhere
    seed = int(random.integers(1000))
    law, parameters = SURFACES[int(random.integers(len(SURFACES)))]
    return replace(
        nowhere,
        law=law,
        parameters=parameters,
        texture=with_map_errors(texture, seed % GRAINS, MAP_NOISE, 1.0),
        map_from_body=rotation_from_vector_deg(random.normal(0, MAP_FRAME_DEG, 3)),
        relief=random_relief(random, (target.relief_km or 0.0) / target.mean_radius_km),
    )


def _disk(camera: Camera, pose: Pose, surface: Solid) -> Array:
    """Light (ny, nx) of the body, blurred as the camera does."""
    from scipy.ndimage import gaussian_filter

    solid = replace(surface, centre_km=pose.target_from_spacecraft_km, body_from_j2000=pose.body_from_j2000)
    nx, ny = camera.size_px
    view = View(pose.camera_from_j2000, camera.focal_length_px, camera.centre_px, 0, 0, nx, ny, OVERSAMPLE)
    fine = render(view, [solid], pose.sun_from_target_km / np.linalg.norm(pose.sun_from_target_km))
    fine = gaussian_filter(fine, camera.psf_sigma_px * OVERSAMPLE)
    light = fine.reshape(ny, OVERSAMPLE, nx, OVERSAMPLE).mean(axis=(1, 3)).astype(np.float64)
    return np.asarray(PEAK * light / light.max())


def _stars(camera: Camera, pose: Pose, catalog: Path, random: np.random.Generator) -> Array:
    """Light (ny, nx) of the stars that the body does not hide; the catalog goes into a file."""
    import pandas as pd

    degrees = np.degrees(np.array(camera.size_px) / camera.focal_length_px)
    axis = pose.camera_from_j2000[2]
    sky = made_up_sky(axis, float(3 * degrees.max()), STARS_IN_FRAME / float(np.prod(degrees)), random)
    table = sky.table
    columns = {"ra": table.ra_deg, "dec": table.dec_deg, "mag": table.magnitude, "epoch": table.epoch}
    motions = {"pmra": table.pm_ra_mas, "pmdec": table.pm_dec_mas}
    pd.DataFrame(columns | motions).to_parquet(catalog, index=False)
    directions = seen_directions(table, YEAR, np.asarray(pose.spacecraft_velocity_km_s))
    to_target = pose.target_from_spacecraft_km / pose.range_km
    hidden = directions @ to_target > np.cos(1.0 * find_target("europa").mean_radius_km / pose.range_km)
    signal = np.minimum(5.0 * 10 ** (0.4 * (12.0 - table.magnitude)), 400.0)
    heights = np.array([height_of(each, camera.psf_sigma_px) for each in signal])
    places = places_of(camera, pose.camera_from_j2000, directions)
    shown = np.isfinite(places).all(axis=1) & ~hidden
    return star_picture(camera.size_px[::-1], places[shown], heights[shown], camera.psf_sigma_px)
