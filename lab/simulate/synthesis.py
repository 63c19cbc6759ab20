"""One synthetic image: what is true, what the detector recorded, and what the wrong metadata say."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from catalog.basemap import BaseMap, map_of_target
from catalog.camera import Camera
from catalog.pose import Pose
from catalog.target import Target
from lab.simulate.cameras import simulated_camera
from lab.simulate.detector import (
    Exposure,
    Recorded,
    clean_exposure,
    exposed_frame,
    recorded,
    usual_exposure,
)
from lab.simulate.errors import PlantedErrors, drawn_errors
from lab.simulate.optics import TrueOptics, nominal_optics, true_optics
from lab.simulate.picture import Picture, picture_of
from lab.simulate.randomness import generator
from lab.simulate.surface import TrueSurface, matched_surface, mismatched_surface
from tasks.simulate.window import disk_radius_px

PSF_ERROR = 0.2


@dataclass(frozen=True)
class TrueImage:
    """An image to be made. pose: the truth. errors, surface, exposure: None draws them."""

    product: str
    camera: Camera
    target: Target
    pose: Pose
    exposure_s: float
    errors: PlantedErrors | None = None
    surface: TrueSurface | None = None
    exposure: Exposure | None = None


@dataclass(frozen=True)
class Synthetic:
    """A made image. picture: without distortion and detector; predicted: the wrong pose; facts: all that was planted,
    as plain JSON values."""

    image: TrueImage
    picture: Picture
    recorded: Recorded
    predicted: Pose
    errors: PlantedErrors
    optics: TrueOptics
    facts: dict[str, Any]


def synthesise(image: TrueImage, seed: int, basemap: BaseMap | None = None, matched: bool = False) -> Synthetic:
    """Make one image; the same seed and product give the same pixels, whatever else is made.

    basemap: the true albedo (default: the catalog's map). matched: the corrections' assumptions hold (their mixture of
    laws, map, PSF, distortion and noise), so that the residual errors are those of noise and method.
    """
    camera, target = image.camera, image.target

    def random(purpose: str) -> np.random.Generator:
        return generator(seed, image.product, purpose)

    habits, offsets = simulated_camera(camera.name).detector, simulated_camera(camera.name).offset_px
    chosen_map = map_of_target(target) if basemap is None or matched else basemap
    new_surface = (matched_surface if matched else mismatched_surface)(random("surface"), chosen_map)
    surface = image.surface or new_surface
    psf_factor = 1.0 if matched else float(random("psf").choice([1 - PSF_ERROR, 1 + PSF_ERROR]))
    optics = nominal_optics(camera) if matched else true_optics(camera, random("optics"), habits.marks_shift_px)
    new_exposure = clean_exposure(camera, habits) if matched else usual_exposure(camera, habits, random("exposure"))
    exposure = image.exposure or new_exposure
    errors = image.errors or drawn_errors(random("errors"), camera, offsets, target)

    picture = picture_of(image.pose, camera, target, surface, camera.psf_sigma_px * psf_factor)
    frame, optics = exposed_frame(picture, optics, camera, exposure)
    sent = recorded(frame, camera, exposure, random("noise"), optics.visible_marks_xy())
    facts = {
        "product": image.product,
        "camera": camera.name,
        "target": target.name,
        "seed": seed,
        "matched": matched,
        "planted": errors.to_dict(),
        "geometry": _geometry(image),
        "surface": surface.facts(),
        "psf": {"sigma_px": camera.psf_sigma_px * psf_factor, "factor": psf_factor},
        "optics": optics.facts,
        "detector": sent.facts,
        "pose": image.pose.to_dict(),
    }
    return Synthetic(image, picture, sent, errors.predicted(image.pose, camera), errors, optics, facts)


def _geometry(image: TrueImage) -> dict[str, Any]:
    camera, pose = image.camera, image.pose
    return {
        "centre_px": camera.project(pose.target_in_camera_km).tolist(),
        "diameter_px": 2 * float(disk_radius_px(pose, camera, image.target)),
        "range_km": pose.range_km,
        "phase_deg": pose.phase_deg,
    }
