"""Focal length and radial distortion of the cameras as unknowns of a bundle, the same in all images of a camera.

With q where the camera as it is known has a point of the ground, it is measured at

    p = c + d (1 + k |d|^2 / R^2),   d = (1 + a) (q - c),

pixels (Brown 1971, Photogramm. Eng. 37, 855, its first radial term), as `tasks.stars.camera_fit` has it: centre c, half
diagonal R of the largest frame. a scales the picture as the range does: it is known as well as the ranges are."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera
from catalog.camera_constants import SOLVABLE, corner_of
from tasks.control.settings import ControlSettings

Array = NDArray[np.float64]
LEAST_SIGMA = 1e-9  # of a focal length that its camera file states exactly


@dataclass(frozen=True)
class CameraConstants:
    """cameras: one per group, those of `of_image` (images,); corner_px (groups,): R. free: columns of SOLVABLE that are
    solved; values (groups, 2): a and k; prior_sigma (groups, 2)."""

    cameras: tuple[Camera, ...]
    of_image: NDArray[np.intp]
    centres: Array
    corner_px: Array
    free: NDArray[np.intp]
    prior_sigma: Array
    values: Array = field(repr=False)

    @property
    def count(self) -> int:
        """How many unknowns."""
        return len(self.cameras) * len(self.free)

    @property
    def moves(self) -> Array:
        """Values of the unknowns (count,), those of a camera beside each other."""
        return np.asarray(self.values[:, self.free].ravel())

    @property
    def information(self) -> Array:
        """Of the priors of the unknowns (count,)."""
        return np.asarray(self.prior_sigma[:, self.free].ravel() ** -2.0)

    def moved(self, step: Array) -> "CameraConstants":
        """With a step (count,) of the unknowns."""
        values = self.values.copy()
        values[:, self.free] += step.reshape(len(self.cameras), len(self.free))
        return CameraConstants(
            self.cameras, self.of_image, self.centres, self.corner_px, self.free, self.prior_sigma, values
        )

    def measured_at(self, image: int, xy_px: Array) -> Array:
        """Where places (n, 2) of the known camera are measured in an image."""
        group = self.of_image[image]
        (scale, bent), corner = self.values[group], self.corner_px[group]
        away = (1 + scale) * (xy_px - self.centres[image])
        return np.asarray(self.centres[image] + away * (1 + bent * (away**2).sum(axis=-1, keepdims=True) / corner**2))

    def derivatives(self, image: int, xy_px: Array) -> Array:
        """Of the measured places (n, 2, count) by the unknowns, at places (n, 2) of the known camera."""
        group = self.of_image[image]
        (scale, bent), corner = self.values[group], self.corner_px[group]
        away = xy_px - self.centres[image]
        squared = (1 + scale) ** 2 * (away**2).sum(axis=-1, keepdims=True) / corner**2
        parts = np.stack([away * (1 + 3 * bent * squared), (1 + scale) * away * squared], axis=-1)
        found = np.zeros((len(xy_px), 2, len(self.cameras), len(self.free)))
        found[:, :, group] = parts[:, :, self.free]
        return found.reshape(len(xy_px), 2, self.count)


def constants_of(cameras: Sequence[Camera], settings: ControlSettings) -> CameraConstants:
    """The constants of images' cameras (one per image), those of one name and focal length together. As known
    beforehand: the focal length to what the camera file says, nothing of the distortion left to
    `prior_distortion_px` in the corner."""
    groups: dict[tuple[str, float], list[Camera]] = {}
    keys = [(camera.name, camera.focal_length_px) for camera in cameras]
    for key, camera in zip(keys, cameras, strict=True):
        groups.setdefault(key, []).append(camera)
    order = list(groups)
    corners = np.array([max(map(corner_of, members)) for members in groups.values()])
    focal = [max(members[0].focal_length_sigma, LEAST_SIGMA) for members in groups.values()]
    return CameraConstants(
        cameras=tuple(members[0] for members in groups.values()),
        of_image=np.array([order.index(key) for key in keys], np.intp),
        centres=np.array([camera.centre_px for camera in cameras]),
        corner_px=corners,
        free=np.array([k for k, name in enumerate(SOLVABLE) if name in settings.solve], np.intp),
        prior_sigma=np.stack([np.array(focal), settings.prior_distortion_px / corners], axis=-1),
        values=np.zeros((len(order), len(SOLVABLE))),
    )


def constant_rows(constants: CameraConstants, covariance: Array) -> list[dict[str, Any]]:
    """A row per camera of what was solved: value, 1-sigma, and 1-sigma beforehand; `None` for what was not."""
    width = len(constants.free)
    rows = []
    for group, camera in enumerate(constants.cameras):
        own = covariance[group * width : (group + 1) * width, group * width : (group + 1) * width]
        sigma = np.zeros(len(SOLVABLE))
        sigma[constants.free] = np.sqrt(np.diag(own))
        (scale, bent), corner = constants.values[group], float(constants.corner_px[group])
        focal, prior = camera.focal_length_px, constants.prior_sigma[group]
        solved = [SOLVABLE[k] for k in constants.free]
        rows.append(
            {
                "camera": camera.name,
                "images": int((constants.of_image == group).sum()),
                "focal_length_px": _value(focal * (1 + scale), focal * sigma[0], focal * prior[0])
                if SOLVABLE[0] in solved
                else None,
                "focal_length_factor": _value(1 + scale, sigma[0], prior[0]) if SOLVABLE[0] in solved else None,
                "distortion": {"corner_px": corner, **_value(bent * corner, sigma[1] * corner, prior[1] * corner)}
                if SOLVABLE[1] in solved
                else None,
                "correlation": float(own[0, 1] / (sigma[0] * sigma[1])) if width == len(SOLVABLE) else None,
            }
        )
    return rows


def _value(value: float, sigma: float, prior: float) -> dict[str, float]:
    return {"value": float(value), "sigma": float(sigma), "sigma_before": float(prior)}


def constant_lines(rows: Sequence[dict[str, Any]]) -> list[str]:
    """The rows for people."""
    lines = []
    for row in rows:
        parts = []
        if factor := row["focal_length_factor"]:
            length = row["focal_length_px"]
            parts.append(
                f"focal length {length['value']:.2f} +- {length['sigma']:.2f} px, {factor['value']:.6f} +- "
                f"{factor['sigma']:.6f} of the camera file's (known to {factor['sigma_before']:.1e} before)"
            )
        if shift := row["distortion"]:
            parts.append(
                f"radial distortion left {shift['value']:+.3f} +- {shift['sigma']:.3f} px "
                f"at {shift['corner_px']:.0f} px from the centre"
            )
        lines.append(f"{row['camera']} ({row['images']} images): {'; '.join(parts)}")
    return lines
