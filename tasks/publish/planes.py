"""The arrays of a cube: what the corrected pose says of every pixel, in the types in which it is stored."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.observation import Quality
from tasks.project.planes import KNOWN_PLANES, PLANES, POINT, Planes, project_planes
from tasks.project.uncertainty import SIZES, coordinate_sigmas
from tasks.publish.publication import Publication

UNCERTAINTY_BITS = 10  # of a float32's 23 mantissa bits: three digits of an uncertainty are enough, and compress well
LIMB_PSF_SIGMAS = 2.0


def cube_arrays(publication: Publication) -> dict[str, NDArray[Any]]:
    """All planes of `variables.VARIABLES` by name, each (ny, nx). Raises RefusedError as `project_planes`."""
    p = publication
    planes = project_planes(p.pose_after, p.camera, p.target, planes=KNOWN_PLANES)
    arrays: dict[str, NDArray[Any]] = {name: planes[name].astype(np.float32) for name in PLANES}
    arrays["longitude"][arrays["longitude"] >= 360] = 0  # 359.99999 rounded to float32
    latitude_sigma, longitude_sigma = _sigmas(publication, planes)
    return arrays | {
        "image": p.observation.image.astype(np.float32),
        "latitude_uncertainty": latitude_sigma,
        "longitude_uncertainty": longitude_sigma,
        "quality": quality_flags(p.observation.quality, planes, p.camera.psf_sigma_px),
    }


def quality_flags(observed: NDArray[np.uint16], planes: Planes, psf_sigma_px: float) -> NDArray[np.uint16]:
    """The observation's flags (ny, nx) with OFF_BODY, NIGHT_SIDE, and LIMB within one pixel and twice the PSF's sigma
    of the edge, on both its sides: there pixels mix body and sky."""
    import cv2

    on_body = planes.on_body
    quality = observed.copy()
    quality[~on_body] |= np.uint16(Quality.OFF_BODY)
    quality[on_body & ~planes.illuminated] |= np.uint16(Quality.NIGHT_SIDE)
    if on_body.any() and not on_body.all():
        inside, outside = (cv2.distanceTransform(m.astype(np.uint8), cv2.DIST_L2, 5) for m in (on_body, ~on_body))
        quality[np.maximum(inside, outside) <= 1.0 + LIMB_PSF_SIGMAS * psf_sigma_px] |= np.uint16(Quality.LIMB)
    return quality


def _sigmas(publication: Publication, planes: Planes) -> NDArray[np.float32]:
    """1-sigma of latitude and longitude (2, ny, nx); NaN off the body, everywhere when nothing is known of the pose."""
    p, on_body = publication, planes.on_body
    sigmas = np.full((2, *on_body.shape), np.nan, dtype=np.float32)
    if len(p.uncertainty.not_included) < len(SIZES):
        points = np.stack([planes[name][on_body] for name in POINT])
        found = coordinate_sigmas(p.pose_after, p.camera, p.target, p.uncertainty, points)
        sigmas[:, on_body] = rounded_to_bits(np.stack(found).astype(np.float32), UNCERTAINTY_BITS)
    return sigmas


def rounded_to_bits(values: NDArray[np.float32], bits: int) -> NDArray[np.float32]:
    """float32 values rounded to `bits` bits of mantissa; NaN stays NaN."""
    dropped = 23 - bits
    raw = values.view(np.uint32)
    rounded = (raw + np.uint32(1 << (dropped - 1))) & ~np.uint32((1 << dropped) - 1)
    return np.where(np.isfinite(values), rounded.view(np.float32), values)
