"""A scene of several bodies as files: FITS image, camera, pose; and the truth."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lab.bodies.caster import cast, rendered
from lab.bodies.scenes import FRAME_PX, Scene
from lab.honesty.caster import View
from lab.honesty.optics import Blur, Detector, blurred

FINE = 3
SKY_SHARE = 0.02


@dataclass(frozen=True)
class Files:
    """What the correction is given."""

    image: Path
    camera: Path
    pose: Path


def view_of(scene: Scene, margin_px: int, fine: int) -> View:
    """The frame and a margin around it, each pixel cut into `fine` x `fine` rays."""
    side, middle = FRAME_PX + 2 * margin_px, (FRAME_PX - 1) / 2
    return View(
        scene.camera_from_j2000, scene.lens.focal_px, (middle, middle), -margin_px, -margin_px, side, side, fine
    )


def picture_of(scene: Scene) -> NDArray[np.int16]:
    """The raw image. The exposure is the target's: what is brighter may be saturated."""
    blur = Blur(scene.lens.psf_px)
    margin = blur.reach_px
    globes, sun = scene.globes(), scene.target_km + scene.sun_km
    lamps = scene.lamps()
    light = blurred(rendered(view_of(scene, margin, FINE), globes, sun, lamps=lamps), blur, FINE)
    light = light[margin:-margin, margin:-margin]
    alone = cast(view_of(scene, 0, 1).rays(0, FRAME_PX), globes, sun, 7)
    own = light.ravel()[alone.body_id == globes[0].naif_id]
    level = float(np.percentile(own, 99)) if own.size else 1.0
    full = scene.lens.full_dn
    seen = light[light > 0.02 * light.max()]
    # `expose` scales by the brightest hundredth of all that is seen; the target is to have 0.6 of the full well.
    peak = 0.6 * full * float(np.percentile(seen, 99)) / max(level, 1e-9)
    detector = Detector(
        peak, full, sky_dn=SKY_SHARE * full, read_dn=scene.lens.read_dn, gain_e_per_dn=scene.lens.gain_e_per_dn
    )
    return detector.expose(light, np.random.default_rng(scene.seed))


def write_scene(scene: Scene, folder: Path) -> Files:
    """Write a scene's files into `folder`."""
    from astropy.io import fits

    folder.mkdir(parents=True, exist_ok=True)
    files = Files(*(folder / f"{scene.id}.{kind}" for kind in ("fits", "toml", "json")))
    fits.writeto(files.image, picture_of(scene), overwrite=True)
    lens, middle = scene.lens, (FRAME_PX - 1) / 2
    files.camera.write_text(
        f'name = "bodies-{lens.name}"\nsize_px = [{FRAME_PX}, {FRAME_PX}]\ncentre_px = [{middle}, {middle}]\n'
        f"focal_length_px = {lens.focal_px!r}\npsf_sigma_px = {lens.psf_px}\nsaturation_dn = {lens.full_dn}\n"
        f"[noise]\nread_dn = {lens.read_dn}\ngain_e_per_dn = {lens.gain_e_per_dn}\nrelative = 0.005\n"
    )
    files.pose.write_text(json.dumps(scene.pose()))
    return files


def truth_of(scene: Scene) -> dict[str, Any]:
    """What every pixel sees: `body_id` and `shadow` (ny, nx), and the target's place `centre_px` (2,)."""
    seen = cast(view_of(scene, 0, 1).rays(0, FRAME_PX), scene.globes(), scene.target_km + scene.sun_km, 61)
    shape = (FRAME_PX, FRAME_PX)
    return {
        "body_id": seen.body_id.reshape(shape),
        "shadow": seen.shadow.reshape(shape),
        "centre_px": scene.centre_px,
    }
