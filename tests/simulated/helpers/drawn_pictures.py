"""Drawn scenes whose picture is spoiled: by the detector, the optics, the telemetry, the light, other bodies."""

from dataclasses import replace

import cv2
import numpy as np
from drawn import MAPPED, Drawn, drawn, picture, scene_of, side_of
from hostile import Hostile
from ray_caster import Body, blotches


def noise_only(rng: np.random.Generator) -> Hostile:
    made = drawn(rng)
    return scene_of(made, "empty", rng.normal(20, 6, made.image.shape), truth=None)


def too_faint(rng: np.random.Generator) -> Hostile:
    made = drawn(rng)
    return scene_of(made, "faint", picture(made, rng, peak=float(rng.uniform(0.3, 1.2))))


def clouded(rng: np.random.Generator) -> Hostile:
    made = drawn(rng, MAPPED)
    return scene_of(made, "map", picture(made, rng, surface=blotches(made.seed % 999, float(rng.uniform(0.3, 0.55)))))


def saturated(rng: np.random.Generator) -> Hostile:
    made = drawn(rng)
    return scene_of(made, "saturated", np.round(np.minimum(made.image, 0.06 * made.image.max())))


def limb_saturated(rng: np.random.Generator) -> Hostile:
    """The bright limb is clipped, the rest of the disk is not."""
    made = drawn(rng, phase_deg=float(rng.uniform(15, 60)))
    clip = float(np.percentile(made.image[made.image > 0.1 * made.image.max()], 55))
    return scene_of(made, "saturated", np.round(np.minimum(made.image, clip)))


def hot_pixels(rng: np.random.Generator) -> Hostile:
    made = drawn(rng)
    image, side = np.round(20 + (made.image - 20) * 0.3), side_of(made)
    image[rng.integers(0, side, 90), rng.integers(0, side, 90)] = 4095
    return scene_of(made, "specks", image)


def missing_lines(rng: np.random.Generator) -> Hostile:
    made = drawn(rng)
    image = made.image.copy()
    image[np.arange(side_of(made)) % 3 != int(rng.integers(3))] = np.nan
    return scene_of(made, "lines", image)


def zero_filled(rng: np.random.Generator) -> Hostile:
    made = drawn(rng)
    image, first = made.image.copy(), int(rng.integers(20, side_of(made) // 2))
    image[first : first + side_of(made) // 2 : 2] = 0
    return scene_of(made, "lines", image)


def truncated(rng: np.random.Generator) -> Hostile:
    made = drawn(rng)
    image = made.image.copy()
    _, y = made.camera.project(made.truth.target_in_camera_km)
    image[int(max(y - made.radius_px * rng.uniform(0.6, 1.2), 8)) :] = 0 if rng.integers(2) else np.nan
    return scene_of(made, "lines", image)


def blurred(rng: np.random.Generator) -> Hostile:
    made = drawn(rng)
    return scene_of(made, "blur", picture(made, rng, psf_px=float(rng.uniform(0.11, 0.2)) * made.radius_px))


def smeared(rng: np.random.Generator) -> Hostile:
    made = drawn(rng)
    length = int(made.radius_px * rng.uniform(0.5, 0.9))
    line = np.zeros((2 * length + 1, 2 * length + 1), np.uint8)
    dx, dy = (length / 2 * f(rng.uniform(0, np.pi)) for f in (np.cos, np.sin))
    ends = ((int(length - dx), int(length - dy)), (int(length + dx), int(length + dy)))
    kernel = cv2.line(line, *ends, 1).astype(np.float64)
    clean = cv2.filter2D(made.image - 20, -1, kernel / kernel.sum(), borderType=cv2.BORDER_REPLICATE)
    return scene_of(made, "blur", clean + 20 + rng.normal(0, 5, clean.shape))


def planet_beside(rng: np.random.Generator) -> Hostile:
    made = drawn(rng, radius_px=float(rng.uniform(24, 45)))
    radius = made.radius_px * float(rng.uniform(4, 7))
    return scene_of(
        made, "other body", picture(made, rng, others=(neighbour(made, radius, float(rng.uniform(4, 25)), rng),))
    )


def planet_behind(rng: np.random.Generator) -> Hostile:
    made = drawn(rng, radius_px=float(rng.uniform(24, 40)))
    radius = made.radius_px * float(rng.uniform(4, 7))
    gap = -made.radius_px * float(rng.uniform(0.5, 2.0))
    return scene_of(made, "other body", picture(made, rng, others=(neighbour(made, radius, gap, rng),)))


def moon_beside(rng: np.random.Generator) -> Hostile:
    """A second disk, of about the target's size and brighter."""
    made = drawn(rng, radius_px=float(rng.uniform(24, 40)))
    other = neighbour(made, made.radius_px * float(rng.uniform(0.8, 1.3)), float(rng.uniform(3, 20)), rng)
    return scene_of(made, "other body", picture(made, rng, others=(replace(other, albedo=1.8),)))


def neighbour(made: Drawn, radius_px: float, gap_px: float, rng: np.random.Generator) -> Body:
    """A body behind the target, its limb gap_px from the target's."""
    pose, away = made.truth, made.radius_px + radius_px + gap_px
    way = rng.uniform(0, 2 * np.pi)
    x, y = made.camera.project(pose.target_in_camera_km) + away * np.array([np.cos(way), np.sin(way)])
    range_km = 3 * pose.range_km
    sight = made.camera.ray((x, y)) @ pose.camera_from_j2000
    size_km = radius_px * range_km / made.camera.focal_length_px
    return Body(sight * range_km, np.full(3, size_km), np.eye(3), None, float(rng.uniform(0.7, 1.5)))


def masked(rng: np.random.Generator) -> Hostile:
    """A mask covers the disk."""
    made = drawn(rng)
    x, y = made.camera.project(made.truth.target_in_camera_km)
    yy, xx = np.mgrid[: side_of(made), : side_of(made)]
    mask = np.hypot(xx - x, yy - y) < made.radius_px * float(rng.uniform(1.1, 1.4))
    return scene_of(made, "masked", truth=None, mask=mask)


def eclipsed(rng: np.random.Generator) -> Hostile:
    """Another body's shadow lies on the disk."""
    made = drawn(rng, phase_deg=float(rng.uniform(15, 60)))
    x, y = made.camera.project(made.truth.target_in_camera_km)
    sun = made.truth.camera_from_j2000 @ made.truth.sun_from_target_km
    way = np.arctan2(sun[1], sun[0]) + rng.uniform(-0.6, 0.6)
    yy, xx = np.mgrid[: side_of(made), : side_of(made)]
    reach = made.radius_px * float(rng.uniform(0.1, 0.5))
    depth = (xx - x) * np.cos(way) + (yy - y) * np.sin(way) - reach
    return scene_of(made, "shadow", 20 + (made.image - 20) / (1 + np.exp(np.clip(depth, -60, 60) / 1.5)))


def stray_light(rng: np.random.Generator) -> Hostile:
    made = drawn(rng)
    yy, xx = np.mgrid[: side_of(made), : side_of(made)] / side_of(made)
    way = rng.uniform(0, 2 * np.pi)
    slope = np.cos(way) * xx + np.sin(way) * yy
    glow = float(rng.uniform(0.8, 2.5)) * made.image.max() * (slope - slope.min()) ** 2
    return scene_of(made, "stray light", made.image + glow)


def compressed(rng: np.random.Generator) -> Hostile:
    made = drawn(rng)
    small = np.clip(255 * made.image / made.image.max(), 0, 255).astype(np.uint8)
    _, coded = cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, int(rng.integers(1, 4))])
    return scene_of(made, "blocks", cv2.imdecode(coded, cv2.IMREAD_GRAYSCALE).astype(np.float64))
