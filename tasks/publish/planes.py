"""The arrays of a cube: what the corrected pose says of every pixel, in the types in which it is stored."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.observation import Quality
from catalog.pose import Pose
from catalog.target import Target
from tasks.bodies.placed import bodies_of
from tasks.bodies.seen import Seen, as_backplanes, has_company, seen_by_frame, seen_by_places
from tasks.project.backplanes import KNOWN_PLANES, PLANES, POINT, SUNLIT, Backplanes, full_window
from tasks.project.planes import project_planes
from tasks.project.uncertainty import NEEDED, coordinate_sigmas
from tasks.publish.publication import Publication
from tasks.publish.sensor import pixel_sizes, sampled_at_places, sensor_planes, sensor_quality

UNCERTAINTY_BITS = 10  # of a float32's 23 mantissa bits: three digits of an uncertainty are enough, and compress well
LIMB_PSF_SIGMAS = 2.0


def cube_arrays(publication: Publication) -> dict[str, NDArray[Any]]:
    """All planes of `variables.variables_of` by name, each (ny, nx). Raises RefusedError as `project_planes`."""
    p = publication
    planes, observed, psf_sigma_px, company = _seen(p)
    arrays: dict[str, NDArray[Any]] = {name: planes[name].astype(np.float32) for name in PLANES}
    arrays["longitude"][arrays["longitude"] >= 360] = 0  # 359.99999 rounded to float32
    place_px = _place_sigmas(p)
    latitude_sigma, longitude_sigma = _sigmas(p, planes, place_px, company)
    arrays |= {
        "image": p.pixels.image.astype(np.float32),
        "latitude_uncertainty": latitude_sigma,
        "longitude_uncertainty": longitude_sigma,
        "distortion_uncertainty": rounded_to_bits(place_px, UNCERTAINTY_BITS),
        "quality": quality_flags(observed, planes, psf_sigma_px, company.body_id if company else None),
    }
    if company:
        arrays |= body_arrays(company)
        arrays["quality"] |= body_flags(company, p.target.naif_id)
    return arrays | _sensor_arrays(p)


def body_arrays(seen: Seen) -> dict[str, NDArray[Any]]:
    """The planes of `variables.BODY_VARIABLES`."""
    return {
        "body_id": seen.body_id,
        "shadow": np.clip(seen.shadow, 0.0, 1.0).astype(np.float32),
        "ring_optical_depth": seen.ring_depth.astype(np.float32),
    }


def body_flags(seen: Seen, target_id: int) -> NDArray[np.uint16]:
    """OCCULTED, ECLIPSED and OTHER_BODY (ny, nx)."""
    other = (seen.body_id != 0) & (seen.body_id != target_id) | (seen.ring_depth > 0)
    flagged = {Quality.OCCULTED: seen.occulted, Quality.ECLIPSED: seen.shadow > 0, Quality.OTHER_BODY: other}
    flags = np.zeros(seen.body_id.shape, np.uint16)
    for flag, where in flagged.items():
        flags[where] |= np.uint16(flag)
    return flags


def _seen(p: Publication) -> tuple[Backplanes, NDArray[np.uint16], float, Seen | None]:
    """What the cube's pixels see, their flags, the PSF's sigma in such pixels, and whatever other bodies make of it."""
    several = has_company(p.pose_after, p.camera, p.target)
    if p.sensor is None:
        flags, psf_sigma_px = p.observation.quality, p.camera.psf_sigma_px
        if several:
            seen = seen_by_frame(p.pose_after, p.camera, p.target)
            return as_backplanes(seen, full_window(p.camera)), flags, psf_sigma_px, seen
        shadows = () if p.target.shape is None else (SUNLIT,)
        planes = project_planes(p.pose_after, p.camera, p.target, planes=(*KNOWN_PLANES, *shadows))
        return planes, flags, psf_sigma_px, None
    sensor = p.sensor
    flags = sensor_quality(sensor, p.observation.quality)
    psf_sigma_px = p.camera.psf_sigma_px / float(np.median(pixel_sizes(sensor.xy_px)))
    if several:

        def project(pose: Pose, target: Target) -> Mapping[str, NDArray[np.float64]]:
            return sensor_planes(pose, p.camera, target, sensor).planes

        seen = seen_by_places(p.pose_after, p.camera, p.target, sensor.xy_px, project)
        ny, nx = sensor.observation.image.shape
        return as_backplanes(seen, (0, 0, nx, ny)), flags, psf_sigma_px, seen
    return sensor_planes(p.pose_after, p.camera, p.target, sensor), flags, psf_sigma_px, None


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


def quality_flags(
    observed: NDArray[np.uint16], planes: Backplanes, psf_sigma_px: float, body_id: NDArray[np.int32] | None = None
) -> NDArray[np.uint16]:
    """The observation's flags (ny, nx) with OFF_BODY, NIGHT_SIDE, and LIMB within one pixel and twice the PSF's sigma
    of a body's edge, on both its sides: there pixels mix body and sky, or two bodies."""
    import cv2

    on_body = planes.on_body
    bodies = [on_body] if body_id is None else [body_id == each for each in np.unique(body_id[body_id != 0])]
    quality = observed.copy()
    quality[~on_body] |= np.uint16(Quality.OFF_BODY)
    quality[on_body & ~planes.illuminated] |= np.uint16(Quality.NIGHT_SIDE)
    for body in bodies:
        if body.any() and not body.all():
            inside, outside = (cv2.distanceTransform(m.astype(np.uint8), cv2.DIST_L2, 5) for m in (body, ~body))
            quality[np.maximum(inside, outside) <= 1.0 + LIMB_PSF_SIGMAS * psf_sigma_px] |= np.uint16(Quality.LIMB)
    return quality


def _sigmas(
    p: Publication, planes: Backplanes, place_px: NDArray[np.float32], company: Seen | None
) -> NDArray[np.float32]:
    """1-sigma of latitude and longitude (2, ny, nx) from pose and distortion; NaN off the body, everywhere when nothing
    is known of the pose. What is unknown of the distortion counts as 0. On other bodies the pose's errors count as on
    the target; the error of their own place relative to it is not included."""
    on_body = planes.on_body
    sigmas = np.full((2, *on_body.shape), np.nan, dtype=np.float32)
    if len(p.uncertainty.not_included) < len(NEEDED):
        for pose, target, here in _parts(p, on_body, company):
            points = np.stack([planes[name][here] for name in POINT])
            place = np.nan_to_num(place_px[here])
            found = coordinate_sigmas(pose, p.camera, target, p.uncertainty, points, place)
            sigmas[:, here] = rounded_to_bits(np.stack(found).astype(np.float32), UNCERTAINTY_BITS)
    return sigmas


def _parts(
    p: Publication, on_body: NDArray[np.bool_], company: Seen | None
) -> Iterator[tuple[Pose, Target, NDArray[np.bool_]]]:
    """Each body, as pose and target, with the pixels (ny, nx) that see it."""
    if company is None:
        yield p.pose_after, p.target, on_body
        return
    for body in bodies_of(p.pose_after, p.target):
        here = company.body_id == body.naif_id
        if here.any():
            yield body.pose, body.target, here


def rounded_to_bits(values: NDArray[np.float32], bits: int) -> NDArray[np.float32]:
    """float32 values rounded to `bits` bits of mantissa; NaN stays NaN."""
    dropped = 23 - bits
    raw = values.view(np.uint32)
    rounded = (raw + np.uint32(1 << (dropped - 1))) & ~np.uint32((1 << dropped) - 1)
    return np.where(np.isfinite(values), rounded.view(np.float32), values)
