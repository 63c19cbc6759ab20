"""A scene's picture and files: FITS image, camera TOML, pose JSON, base map."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from catalog.target import Target, find_target
from lab.honesty.caster import View, render
from lab.honesty.geometry import (
    Geometry,
    planted_errors,
    predicted_geometry,
    random_of,
    seen_geometry,
    seen_place_px,
    true_geometry,
)
from lab.honesty.optics import Blur, Detector, bending, blurred
from lab.honesty.recording import Recorded, spoiled
from lab.honesty.scene import LENSES, Other, Scene
from lab.honesty.solids import (
    Relief,
    Solid,
    Terrain,
    Texture,
    packaged_texture,
    procedural_texture,
    random_relief,
    random_terrain,
    with_map_errors,
    write_map,
)

Array = NDArray[np.float64]
# Depths over the target's distance; a shadow's caster stands so many radii before it.
FRONT, BEHIND, SHADOW_RADII = 0.6, 1.4, 40.0
PROCEDURAL_SEEDS = 3
GRAINS = 4
# Relief, relative to the radius, that is still slight.
MOST_TERRAIN = 0.02
OVERSAMPLE = ((60.0, 5), (150.0, 4), (320.0, 3))


@dataclass(frozen=True)
class Files:
    """What a scene's correction is given. map: None leaves it to the target's own."""

    image: Path
    camera: Path
    pose: Path
    map: Path | None


def oversample_of(radius_px: float) -> int:
    """Rays per pixel's side."""
    return next((fine for limit, fine in OVERSAMPLE if radius_px <= limit), 2)


def target_solid(scene: Scene, true: Geometry) -> tuple[Solid, dict[str, Any]]:
    """The target as it is, and how it differs from what the catalog says: its radius and the frame of its map by draws
    of their errors, and its surface by the relief that its file states."""
    random = random_of(scene, 3)
    target = find_target(scene.target)
    radius_error = float(random.normal()) * (target.radius_sigma_km or 0.0) / target.mean_radius_km
    texture = surface_texture(scene, target)
    frame_deg = random.normal(size=3) * target.expected_map_frame_deg(len(texture))
    solid = Solid(
        true.target_from_spacecraft_km,
        np.asarray(target.radii_km) * np.asarray(scene.radii) * (1 + radius_error),
        true.body_from_j2000,
        scene.law,
        scene.parameters,
        with_map_errors(texture, scene.seed % GRAINS, scene.map_noise, scene.map_contrast),
        np.asarray(Rotation.from_rotvec(np.radians(frame_deg)).as_matrix()),
        relief=random_relief(random, scene.relief) if scene.relief else stated_terrain(scene, target),
    )
    return solid, {"radius_error": radius_error, "map_frame_deg": [float(a) for a in frame_deg]}


def stated_terrain(scene: Scene, target: Target) -> Terrain | None:
    """The relief that the target's file states, or that bodies of its size have."""
    relief = target.expected_relief_km / target.mean_radius_km
    return random_terrain(random_of(scene, 8), relief) if 0 < relief < MOST_TERRAIN else None


def surface_texture(scene: Scene, target: Target) -> Texture:
    """What the body's markings are, before the map's errors."""
    if scene.surface == "map" and target.basemap:
        return packaged_texture(target.basemap)
    if scene.surface.endswith(".jpg"):
        return packaged_texture(scene.surface)
    other = PROCEDURAL_SEEDS if scene.surface == "shuffled" else 0
    return procedural_texture(scene.seed % PROCEDURAL_SEEDS + other)


def other_solid(other: Other, target: Solid, true: Geometry, sun: Array) -> Solid:
    """Another body, with the target's law and no markings."""
    radius = float(np.cbrt(np.prod(target.radii_km)))
    sight = target.centre_km / np.linalg.norm(target.centre_km)
    angle = np.radians(other.angle_deg)
    across = true.camera_from_j2000.T @ np.array([np.cos(angle), np.sin(angle), 0.0])
    if other.kind == "shadow":
        across -= sun * (across @ sun)
        centre = target.centre_km + SHADOW_RADII * radius * sun
        centre = centre + other.apart * radius * across / np.linalg.norm(across)
        size = other.size
    else:
        depth = FRONT if other.kind == "front" else BEHIND
        across -= sight * (across @ sight)
        centre = depth * (target.centre_km + other.apart * radius * across / np.linalg.norm(across))
        size = other.size * depth
    return Solid(
        centre, np.full(3, size * radius), np.eye(3), target.law, target.parameters, brightness=other.brightness
    )


def window_of(scene: Scene, true: Geometry, solids: list[Solid], margin_px: int) -> tuple[int, int, int, int]:
    """x0, y0, columns, rows around all solids and the light that they spread, cut at the frame and as much beyond."""
    low, high = np.full(2, np.inf), np.full(2, -np.inf)
    for solid in solids:
        v = true.camera_from_j2000 @ solid.centre_km
        if v[2] <= 0:
            continue
        place = v[:2] / v[2] * true.focal_px + np.asarray(true.centre_px)
        reach = 1.6 if isinstance(solid.relief, Relief) else 1.06
        radius_px = reach * true.focal_px * solid.radii_km.max() / float(np.linalg.norm(solid.centre_km))
        low, high = np.minimum(low, place - radius_px), np.maximum(high, place + radius_px)
    first = np.clip(np.floor(low) - margin_px, -margin_px, scene.frame_px).astype(int)
    last = np.clip(np.ceil(high) + margin_px + 1, 0, scene.frame_px + margin_px).astype(int)
    columns, rows = np.maximum(last - first, 1)
    return int(first[0]), int(first[1]), int(columns), int(rows)


def light_of(scene: Scene, true: Geometry) -> tuple[Array, dict[str, Any]]:
    """Light (side, side) on the detector, before the picture is mirrored or turned, and what the target differs by."""
    lens = LENSES[scene.lens]
    blur = Blur(
        scene.blur_px or lens.psf_px * scene.psf_factor,
        scene.ratio,
        scene.wings,
        moffat=scene.moffat,
        smear_px=scene.smear_px,
        smear_deg=float(random_of(scene, 4).uniform(0, 180)),
    )
    target, differs = target_solid(scene, true)
    sun = true.sun_from_target_km / np.linalg.norm(true.sun_from_target_km)
    solids = [target, *(other_solid(other, target, true, sun) for other in scene.others)]
    seen = [target, *(s for s, o in zip(solids[1:], scene.others, strict=True) if o.kind != "shadow")]
    x0, y0, columns, rows = window_of(scene, true, seen, blur.reach_px)
    fine = oversample_of(scene.radius_px)
    place = true.place_px()
    shift = bending(random_of(scene, 5), scene.distortion_px, (float(place[0]), float(place[1])), scene.radius_px)
    view = View(true.camera_from_j2000, true.focal_px, true.centre_px, x0, y0, columns, rows, fine, shift)
    light = blurred(render(view, solids, sun), blur, fine)
    frame = np.zeros((scene.frame_px, scene.frame_px))
    top, left = max(y0, 0), max(x0, 0)
    bottom, right = min(y0 + rows, scene.frame_px), min(x0 + columns, scene.frame_px)
    frame[top:bottom, left:right] = light[top - y0 : bottom - y0, left - x0 : right - x0]
    return frame, differs | {"smear_deg": blur.smear_deg}


def expose(scene: Scene, light: Array, place: Array) -> NDArray[np.int16]:
    """The file's picture. place: (x, y) of the target's centre in it, before it is mirrored or turned."""
    lens = LENSES[scene.lens]
    detector = Detector(
        scene.exposure * lens.full_dn,
        lens.full_dn,
        sky_dn=0.02 * lens.full_dn,
        read_dn=lens.read_dn * scene.noise_factor,
        gain_e_per_dn=lens.gain_e_per_dn / scene.noise_factor**2,
        gamma=scene.gamma,
        hot=scene.hot,
    )
    raw = detector.expose(light, random_of(scene, 6))
    if scene.fault:
        where = (float(place[0]), float(place[1]))
        random = random_of(scene, 9)
        seen = Recorded(raw.astype(np.float64), scene.fault_size, lens.full_dn, where, scene.radius_px, random)
        raw = spoiled(seen, scene.fault)
    if scene.picture.startswith("mirrored"):
        return np.ascontiguousarray(np.flip(raw, axis={"mirrored-x": 1, "mirrored-y": 0}[scene.picture]))
    quarters = {"as-is": 0, "turned-90": 1, "turned-180": 2}[scene.picture]
    return np.ascontiguousarray(np.rot90(raw, quarters))


def write_scene(scene: Scene, folder: Path) -> tuple[Files, dict[str, Any]]:
    """Render a scene into `folder`; its files, and the truth as plain JSON: `pose` of what is seen, `place_px` of the
    target's centre, `planted` errors of the metadata, and what else differs."""
    from astropy.io import fits

    folder.mkdir(parents=True, exist_ok=True)
    true = true_geometry(scene)
    errors = planted_errors(scene)
    predicted = predicted_geometry(scene, true, errors)
    light, differs = light_of(scene, true)
    files = Files(
        folder / f"{scene.id}.fits", folder / f"{scene.id}.toml", folder / f"{scene.id}.json", given_map(scene, folder)
    )
    fits.writeto(files.image, expose(scene, light, true.place_px()), overwrite=True)
    files.camera.write_text(camera_text(scene, predicted))
    stated = {"errors": scene.stated_errors} if scene.stated_errors else {}
    files.pose.write_text(json.dumps(predicted.pose() | stated))
    truth = {
        "pose": seen_geometry(scene, true).pose(),
        "place_px": seen_place_px(scene, true).tolist(),
        "range_scale": range_scale(scene),
        "planted": errors | differs,
    }
    return files, truth


def range_scale(scene: Scene) -> float:
    """The range that the seen size means for the stated target, over the true one."""
    if scene.reported is None:
        return 1.0
    return find_target(scene.reported).mean_radius_km / find_target(scene.target).mean_radius_km


def given_map(scene: Scene, folder: Path) -> Path | None:
    """The map that the correction is given; None where it is the stated target's own, or none."""
    from catalog.basemap import packaged_map_path

    if scene.given.endswith(".jpg"):
        return packaged_map_path(scene.given)
    if scene.given == "procedural":
        path = folder / "map.png"
        write_map(procedural_texture(scene.seed % PROCEDURAL_SEEDS), path)
        return path
    return None


def camera_text(scene: Scene, predicted: Geometry) -> str:
    """The camera file: what the lens nominally is."""
    lens, middle = LENSES[scene.lens], (scene.frame_px - 1) / 2
    return (
        f'name = "honesty-{lens.name}"\n'
        f"size_px = [{scene.frame_px}, {scene.frame_px}]\n"
        f"centre_px = [{middle}, {middle}]\n"
        f"focal_length_px = {predicted.focal_px!r}\n"
        f"psf_sigma_px = {lens.psf_px}\n"
        f"saturation_dn = {lens.full_dn}\n"
        "[noise]\n"
        f"read_dn = {lens.read_dn}\ngain_e_per_dn = {lens.gain_e_per_dn}\nrelative = 0.005\n"
    )
