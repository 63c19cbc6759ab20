"""The arrays of a cube: what the corrected pose says of every pixel, in the types in which it is stored."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.observation import Quality
from tasks.project.backplanes import KNOWN_PLANES, PLANES, POINT, SUNLIT, Backplanes
from tasks.project.planes import project_planes
from tasks.project.uncertainty import NEEDED, coordinate_sigmas
from tasks.publish.publication import Publication
from tasks.publish.sensor import pixel_sizes, sampled_at_places, sensor_planes, sensor_quality

UNCERTAINTY_BITS = 10  # of a float32's 23 mantissa bits: three digits of an uncertainty are enough, and compress well
LIMB_PSF_SIGMAS = 2.0


def cube_arrays(publication: Publication) -> dict[str, NDArray[Any]]:
    """All planes of `variables.variables_of` by name, each (ny, nx). Raises RefusedError as `project_planes`."""
    p = publication
    planes, observed, psf_sigma_px = _seen(p)
    arrays: dict[str, NDArray[Any]] = {name: planes[name].astype(np.float32) for name in PLANES}
    arrays["longitude"][arrays["longitude"] >= 360] = 0  # 359.99999 rounded to float32
    place_px = _place_sigmas(p)
    latitude_sigma, longitude_sigma = _sigmas(p, planes, place_px)
    arrays |= {
        "image": p.pixels.image.astype(np.float32),
        "latitude_uncertainty": latitude_sigma,
        "longitude_uncertainty": longitude_sigma,
        "distortion_uncertainty": rounded_to_bits(place_px, UNCERTAINTY_BITS),
        "quality": quality_flags(observed, planes, psf_sigma_px),
    }
    return arrays | _sensor_arrays(p)


def _seen(p: Publication) -> tuple[Backplanes, NDArray[np.uint16], float]:
    """What the cube's pixels see, their flags, and the PSF's sigma in such pixels."""
    if p.sensor is None:
        shadows = () if p.target.shape is None else (SUNLIT,)
        planes = project_planes(p.pose_after, p.camera, p.target, planes=(*KNOWN_PLANES, *shadows))
        return planes, p.observation.quality, p.camera.psf_sigma_px
    planes = sensor_planes(p.pose_after, p.camera, p.target, p.sensor)
    psf_sigma_px = p.camera.psf_sigma_px / float(np.median(pixel_sizes(p.sensor.xy_px)))
    return planes, sensor_quality(p.sensor, p.observation.quality), psf_sigma_px


def _place_sigmas(p: Publication) -> NDArray[np.float32]:
    """1-sigma (ny, nx) of each coordinate of the cube's pixels in the undistorted frame; NaN when nobody knows it."""
    place = p.distortion_uncertainty_px
    if place is None:
        return np.full(p.pixels.image.shape, np.nan, dtype=np.float32)
    place = np.ascontiguousarray(place, dtype=np.float32)
    return sampled_at_places(place, p.sensor) if p.sensor else place


def _sensor_arrays(p: Publication) -> dict[str, NDArray[Any]]:
    """What only a cube of unresampled pixels holds: their places, and the frame in which the pose was found."""
    if p.sensor is None:
        return {}
    place_x, place_y = (p.sensor.xy_px[..., axis].astype(np.float32) for axis in range(2))
    return {"place_x": place_x, "place_y": place_y, "resampled_image": p.observation.image.astype(np.float32)}


def quality_flags(observed: NDArray[np.uint16], planes: Backplanes, psf_sigma_px: float) -> NDArray[np.uint16]:
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


def _sigmas(p: Publication, planes: Backplanes, place_px: NDArray[np.float32]) -> NDArray[np.float32]:
    """1-sigma of latitude and longitude (2, ny, nx) from pose and distortion; NaN off the body, everywhere when nothing
    is known of the pose. What is unknown of the distortion counts as 0."""
    on_body = planes.on_body
    sigmas = np.full((2, *on_body.shape), np.nan, dtype=np.float32)
    if len(p.uncertainty.not_included) < len(NEEDED):
        points = np.stack([planes[name][on_body] for name in POINT])
        place = np.nan_to_num(place_px[on_body])
        found = coordinate_sigmas(p.pose_after, p.camera, p.target, p.uncertainty, points, place)
        sigmas[:, on_body] = rounded_to_bits(np.stack(found).astype(np.float32), UNCERTAINTY_BITS)
    return sigmas


def rounded_to_bits(values: NDArray[np.float32], bits: int) -> NDArray[np.float32]:
    """float32 values rounded to `bits` bits of mantissa; NaN stays NaN."""
    dropped = 23 - bits
    raw = values.view(np.uint32)
    rounded = (raw + np.uint32(1 << (dropped - 1))) & ~np.uint32((1 << dropped) - 1)
    return np.where(np.isfinite(values), rounded.view(np.float32), values)
