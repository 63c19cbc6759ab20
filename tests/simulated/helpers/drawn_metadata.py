"""Drawn scenes whose picture is sound and whose metadata, map or framing are not."""

from dataclasses import replace

import numpy as np
from drawn import BODIES, MAPPED, drawn, picture, scene_of, side_of, sun_of
from hostile import Hostile, texture_of
from ray_caster import exposed, pose_of, rendered

from catalog.rotation import rotation_from_vector_deg
from catalog.target import find_target


def other_range(rng: np.random.Generator) -> Hostile:
    made = drawn(rng)
    factor = 1 + float(rng.choice([-1, 1]) * rng.uniform(0.1, 0.3))
    return scene_of(made, "size", pose=made.given.with_range_factor(factor))


def other_mode(rng: np.random.Generator) -> Hostile:
    made = drawn(rng, radius_px=float(rng.uniform(24, 45)))
    focal = made.camera.focal_length_px * float(rng.choice([0.5, 2.0]))
    return scene_of(made, "mode", camera=made.camera.model_copy(update={"focal_length_px": focal}))


def other_camera(rng: np.random.Generator) -> Hostile:
    made = drawn(rng)
    focal = made.camera.focal_length_px * float(rng.choice([rng.uniform(0.66, 0.87), rng.uniform(1.15, 1.5)]))
    return scene_of(made, "size", camera=made.camera.model_copy(update={"focal_length_px": focal}))


def other_target(rng: np.random.Generator) -> Hostile:
    made = drawn(rng)
    radius = find_target(made.target).mean_radius_km
    ratios = {name: find_target(name).mean_radius_km / radius for name in BODIES}
    apart = [name for name, ratio in ratios.items() if 0.42 < ratio < 2.4 and abs(ratio - 1) > 0.12]
    return scene_of(made, "size", target=str(rng.choice(apart)), truth=None)


def sun_turned(rng: np.random.Generator) -> Hostile:
    made = drawn(rng, phase_deg=float(rng.uniform(35, 100)))
    sight = made.given.target_from_spacecraft_km / made.given.range_km
    turn = rotation_from_vector_deg(float(rng.uniform(50, 300)) * sight)
    return scene_of(made, "sun", pose=made.given.replaced(sun_from_target_km=turn @ made.given.sun_from_target_km))


def sun_of_another_time(rng: np.random.Generator) -> Hostile:
    """Another phase angle: of a wrong time or kernel."""
    made = drawn(rng, phase_deg=float(rng.uniform(20, 60)))
    back = -made.given.target_from_spacecraft_km / made.given.range_km
    sun = sun_of(back, float(rng.uniform(95, 125)), rng)
    return scene_of(made, "sun", pose=made.given.replaced(sun_from_target_km=sun))


def another_face(rng: np.random.Generator) -> Hostile:
    made = drawn(rng, MAPPED)
    turn = rotation_from_vector_deg([0, 0, float(rng.uniform(60, 300))])
    return scene_of(made, "map", pose=made.given.replaced(body_from_j2000=turn @ made.given.body_from_j2000))


def behind(rng: np.random.Generator) -> Hostile:
    made = drawn(rng)
    turn = rotation_from_vector_deg([0, float(rng.uniform(120, 178)), 0])
    return scene_of(made, "behind", pose=made.given.replaced(camera_from_j2000=turn @ made.given.camera_from_j2000))


def too_small(rng: np.random.Generator) -> Hostile:
    made = drawn(rng)
    return scene_of(made, "small", pose=made.given.with_range_factor(float(rng.uniform(25, 60))), truth=None)


def too_large(rng: np.random.Generator) -> Hostile:
    made = drawn(rng)
    factor = made.radius_px / (side_of(made) * float(rng.uniform(4, 9)))
    return scene_of(made, "large", pose=made.given.with_range_factor(factor), truth=None)


def mirrored(rng: np.random.Generator) -> Hostile:
    made = drawn(rng, MAPPED, phase_deg=float(rng.uniform(30, 90)))
    way = int(rng.integers(2))
    return scene_of(made, "mirrored", np.flip(made.image, axis=way).copy(), truth=None)


def quarter_turned(rng: np.random.Generator) -> Hostile:
    made = drawn(rng, MAPPED, phase_deg=float(rng.uniform(30, 90)))
    return scene_of(made, "turned", np.rot90(made.image, int(rng.integers(1, 4))).copy(), truth=None)


def negative(rng: np.random.Generator) -> Hostile:
    made = drawn(rng)
    return scene_of(made, "negative", made.image.max() + 20 - made.image)


def map_of_another(rng: np.random.Generator) -> Hostile:
    made = drawn(rng, MAPPED)
    other = str(rng.choice([name for name in MAPPED if name != made.target]))
    return scene_of(made, "map", picture(made, rng, surface=texture_of(other)))


def outside(rng: np.random.Generator) -> Hostile:
    made = drawn(rng, centre_px=(-150.0, float(rng.uniform(20, 180))), radius_px=float(rng.uniform(24, 60)))
    inside = pose_of(made.camera, 1000.0, 40.0, (100.0, 100.0))
    return scene_of(made, "outside", exposed(rendered(inside, made.camera, []) + 0.0, made.seed), truth=None)


def cut_by_the_frame(rng: np.random.Generator) -> Hostile:
    """Less than a sixth of the disk is in the frame."""
    radius = float(rng.uniform(40, 70))
    made = drawn(
        rng, radius_px=radius, centre_px=(-radius * float(rng.uniform(0.7, 0.85)), float(rng.uniform(60, 140)))
    )
    return scene_of(made, "outside")


def limb_outside(rng: np.random.Generator) -> Hostile:
    """The lit limb is beyond the frame's edge; terminator and dark side are in it."""
    made = drawn(rng, phase_deg=80.0, radius_px=80.0)
    sun = made.truth.camera_from_j2000 @ made.truth.sun_from_target_km
    way = sun[:2] / np.hypot(*sun[:2])
    side = side_of(made)
    # From the middle, towards the Sun, until the lit limb has left the frame.
    room = min((side / 2) / max(abs(c), 1e-9) for c in way)
    off = np.degrees(way * (room - 20.0) / made.camera.focal_length_px)
    shift = rotation_from_vector_deg([-off[1], off[0], 0])
    centre = np.degrees(made.camera.project(made.truth.target_in_camera_km) - (side - 1) / 2)
    back = rotation_from_vector_deg(np.array([centre[1], -centre[0], 0]) / made.camera.focal_length_px)
    truth, given = (p.replaced(camera_from_j2000=shift @ back @ p.camera_from_j2000) for p in (made.truth, made.given))
    moved = replace(made, truth=truth, given=given)
    return scene_of(moved, "outside", picture(moved, rng))
