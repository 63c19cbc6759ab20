"""What several images together say of their cameras, as plain JSON and for people."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from catalog.camera import Camera
from catalog.camera_constants import DISTORTION, FOCAL_LENGTH
from tasks.stars.camera_fit import CameraFit, StarFrame, fit_camera
from tasks.stars.field import StarField
from tasks.stars.image import StarImage
from tasks.stars.match import Measured
from tasks.stars.settings import IdentificationSettings

Json = dict[str, Any]


@dataclass
class Together:
    """Images whose stars are identified, by camera. solve: of `camera_fit.SOLVABLE`; nothing is kept without any."""

    solve: tuple[str, ...]
    settings: IdentificationSettings
    frames: dict[str, list[StarFrame]] = field(default_factory=dict)
    cameras: dict[str, Camera] = field(default_factory=dict)

    def add(self, found: StarImage) -> None:
        """One image more, if it has a lock."""
        if not self.solve or found.field.lock is None:
            return
        key = f"{found.camera.name} {found.camera.focal_length_px!r} {found.camera.size_px}"
        self.cameras[key] = found.camera
        self.frames.setdefault(key, []).append(frame_of(found.path.name, found.field))

    def in_json(self) -> list[Json]:
        """A row per camera."""
        rows = []
        for key, frames in self.frames.items():
            camera, settings = self.cameras[key], self.settings
            fit = fit_camera(camera, frames, self.solve, 1.5 * settings.tolerance_px, settings.least_stars)
            rows.append(too_few(camera, frames) if fit is None else fit_in_json(fit, self.solve))
        return rows


def frame_of(name: str, found: StarField) -> StarFrame:
    """A frame with a lock as the fit of its camera takes it. Raises ValueError without a lock."""
    lock = found.lock
    if lock is None:
        raise ValueError(f"{name} has no stars")
    seen = Measured(found.xy_px, found.sigma_px, found.sources.height).only(slice(found.strong))
    matched, magnitude = lock.matched, lock.table.magnitude
    turned = matched.orientation.camera_from_j2000
    return StarFrame(name, lock.directions, magnitude, seen, matched.detection, matched.star, turned)


def too_few(camera: Camera, frames: list[StarFrame]) -> Json:
    """The row of a camera whose frames have too few stars."""
    count = sum(len(each.star) for each in frames)
    return {
        "solved": camera.name,
        "frames": len(frames),
        "stars": count,
        "reason": f"{count} stars in {len(frames)} frames are too few to solve for the camera.",
    }


def fit_in_json(fit: CameraFit, solve: tuple[str, ...]) -> Json:
    """What the frames say of their camera; null for what was not solved. focal_length_px: and its factor over the
    camera file's; distortion: corner_shift_px, how far outward a star in the corner lies of where the camera's own
    distortion model has it, growing with the third power of the distance from the centre. covariance: of the factor
    and the shift over corner_px."""
    camera, sigma = fit.camera, np.sqrt(np.diag(fit.covariance))
    scale, bent = fit.parameters
    focal, corner = camera.focal_length_px, fit.corner_px
    return {
        "solved": camera.name,
        "frames": len(fit.frames),
        "images": [each.name for each in fit.frames],
        "stars": fit.stars,
        "focal_length_px": {"value": focal * (1 + scale), "sigma": focal * sigma[0]} if FOCAL_LENGTH in solve else None,
        "focal_length_factor": {"value": 1 + scale, "sigma": sigma[0]} if FOCAL_LENGTH in solve else None,
        "distortion": {"corner_shift_px": bent * corner, "sigma_px": sigma[1] * corner, "corner_px": corner}
        if DISTORTION in solve
        else None,
        "covariance": fit.covariance.tolist(),
        "rms_px_before": fit.rms_px[0],
        "rms_px": fit.rms_px[1],
        "extra_sigma_px": fit.extra_sigma_px,
        "reason": None,
    }


def solved_text(content: Json) -> str:
    """A row of a camera for people."""
    head = f"{content['solved']}: {content['stars']} stars in {content['frames']} frames"
    if content["reason"]:
        return f"{content['solved']}: {content['reason']}"
    parts = [f"{head}, rms {content['rms_px_before']:.3f} px, after the fit {content['rms_px']:.3f} px"]
    if factor := content["focal_length_factor"]:
        length = content["focal_length_px"]
        parts.append(
            f"focal length {length['value']:.2f} +- {length['sigma']:.2f} px "
            f"({factor['value']:.6f} +- {factor['sigma']:.6f} of the camera file's)"
        )
    if shift := content["distortion"]:
        parts.append(
            f"radial distortion left {shift['corner_shift_px']:+.3f} +- {shift['sigma_px']:.3f} px "
            f"at {shift['corner_px']:.0f} px from the centre"
        )
    return "; ".join(parts)
