"""A small ray caster of ellipsoids, independent of the program's own renderer: numpy and OpenCV's blur only."""

from dataclasses import dataclass

import cv2
import numpy as np

from catalog.camera import Camera
from catalog.pose import Pose
from catalog.rotation import rotation_from_vector_deg

FINE = 3


@dataclass(frozen=True)
class Body:
    """centre_km: from the spacecraft, J2000. radii_km, body_from_j2000: as of a target and a pose. texture: (rows,
    columns) from 0 to 360 deg east, None for a plain one. lambert: share of Lambert's law, the rest Lommel-Seeliger."""

    centre_km: np.ndarray
    radii_km: np.ndarray
    body_from_j2000: np.ndarray
    texture: np.ndarray | None = None
    albedo: float = 1.0
    lambert: float = 0.5


def unit(longitude_deg: float, latitude_deg: float) -> np.ndarray:
    lon, lat = np.radians([longitude_deg, latitude_deg])
    return np.array([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)])


def blotches(seed: int, contrast: float = 0.2) -> np.ndarray:
    """A map of blurred noise; its edges left and right meet."""
    rng = np.random.default_rng(seed)
    noise = rng.standard_normal((256, 512))
    tiled = np.tile(noise, (1, 3))
    sum_ = sum(cv2.GaussianBlur(tiled, (0, 0), width) * width for width in (4, 10, 24))[:, 512:1024]
    return np.clip(1 + contrast * sum_ / sum_.std(), 0.1, 2.0)


def pose_of(
    camera: Camera,
    radius_km: float,
    radius_px: float,
    centre_px: tuple[float, float],
    above_deg: tuple[float, float] = (250.0, 5.0),
    sun_deg: tuple[float, float] = (290.0, 3.0),
    roll_deg: float = 20.0,
) -> Pose:
    """A pose by what the picture shows; longitude and latitude below the spacecraft and the Sun, degrees."""
    range_km = camera.focal_length_px * radius_km / radius_px
    sight = -unit(*above_deg)
    north = np.array([0.0, 0.0, 1.0]) - sight[2] * sight
    down = -north / np.linalg.norm(north)
    rows = rotation_from_vector_deg([0, 0, roll_deg]) @ np.stack([np.cross(down, sight), down, sight])
    wanted = camera.ray(centre_px)
    axis = np.cross([0.0, 0.0, 1.0], wanted)
    sine = np.linalg.norm(axis)
    turn = np.eye(3) if sine == 0 else rotation_from_vector_deg(np.degrees(np.arcsin(sine)) * axis / sine)
    return Pose(2e8, turn @ rows, sight * range_km, unit(*sun_deg) * 7.4e8, np.eye(3))


def body_at(pose: Pose, radii_km: tuple[float, ...], texture: np.ndarray | None, **other: float) -> Body:
    """The target of a pose."""
    return Body(pose.target_from_spacecraft_km, np.array(radii_km), pose.body_from_j2000, texture, **other)


def rendered(pose: Pose, camera: Camera, bodies: list[Body], psf_px: float = 0.9) -> np.ndarray:
    """Radiance (ny, nx), the nearest body in front."""
    nx, ny = camera.size_px
    x = (np.arange(nx * FINE) + 0.5) / FINE - 0.5
    y = (np.arange(ny * FINE) + 0.5) / FINE - 0.5
    rays = camera.ray(np.stack(np.meshgrid(x, y), axis=-1)) @ pose.camera_from_j2000
    sun = pose.sun_from_target_km / np.linalg.norm(pose.sun_from_target_km)
    nearest, light = np.full(rays.shape[:2], np.inf), np.zeros(rays.shape[:2])
    for body in bodies:
        start = -body.body_from_j2000 @ body.centre_km / body.radii_km
        ray = rays @ body.body_from_j2000.T
        scaled = ray / body.radii_km
        a, b, c = (scaled**2).sum(-1), scaled @ start, start @ start - 1
        inside = b**2 - a * c
        distance = np.where((inside > 0) & (b < 0), (-b - np.sqrt(np.maximum(inside, 0))) / a, np.inf)
        seen = distance < nearest
        if not seen.any():
            continue
        point = (start + distance[seen][:, None] * scaled[seen]) * body.radii_km
        normal = point / body.radii_km**2
        normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
        mu0 = np.clip(normal @ (body.body_from_j2000 @ sun), 0, None)
        mu = np.clip(-(normal * ray[seen]).sum(-1), 0, None)
        value = body.lambert * mu0 + (1 - body.lambert) * 2 * mu0 / (mu0 + mu + 1e-9)
        if body.texture is not None:
            rows, columns = body.texture.shape
            latitude = np.degrees(np.arcsin(point[:, 2] / np.linalg.norm(point, axis=-1)))
            longitude = np.degrees(np.arctan2(point[:, 1], point[:, 0])) % 360
            row = np.clip((90 - latitude) / 180 * rows, 0, rows - 1).astype(int)
            value = value * body.texture[row, np.clip(longitude / 360 * columns, 0, columns - 1).astype(int)]
        light[seen], nearest[seen] = value * body.albedo, distance[seen]
    fine = cv2.GaussianBlur(light.astype(np.float32), (0, 0), psf_px * FINE) if psf_px else light
    return fine.reshape(ny, FINE, nx, FINE).mean(axis=(1, 3)).astype(np.float64)


def exposed(
    radiance: np.ndarray, seed: int = 0, peak: float = 2500.0, sky: float = 20.0, read: float = 6.0
) -> np.ndarray:
    """The picture in data numbers, with photon and read noise."""
    rng = np.random.default_rng(seed)
    clean = radiance / max(radiance.max(), 1e-12) * peak
    return rng.poisson(np.clip(clean, 0, None) * 4) / 4 + rng.normal(sky, read, radiance.shape)
