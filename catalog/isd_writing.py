"""Image support data (ISD, JSON) for the Community Sensor Model, written in the form of USGS' ALE."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.body import Target
from catalog.camera import Camera
from catalog.errors import RefusedError
from catalog.newton import Points
from catalog.optics import OpticsModel, optics_of
from catalog.pose import Pose
from catalog.reasons import Reason

Array = NDArray[np.float64]
GRID = 25  # nodes along each side that a distortion is fitted on
NOTHING = {"radial": {"coefficients": [0.0, 0.0, 0.0]}}
MODEL = "USGS_ASTRO_FRAME_SENSOR_MODEL"
J2000 = 1


def undistorted_isd(camera: Camera, pose: Pose, target: Target) -> dict[str, Any]:
    """ISD of the camera's undistorted frame: an exact pinhole of square pixels, whatever the camera's distortion. The
    sensor's frame is the camera's. Where the camera states no pitch a pixel is 0.01 mm."""
    pitch = camera.pixel_pitch_mm or 0.01
    affine = np.eye(2) / pitch
    sensor = _sensor(camera, camera.size_px, camera.focal_length_px * pitch, affine, camera.centre_px, NOTHING)
    return sensor | _geometry(pose, np.eye(3), target)


def detector_isd(camera: Camera, pose: Pose, target: Target) -> tuple[dict[str, Any], float]:
    """ISD of the camera's detector, with its distortion by one of CSM's models; and how far, in pixels, that model is
    from the camera's own at most: 0 where CSM has the very model, else of the fitted cubic polynomials (`transverse`).

    The sensor's frame is that of the focal plane. Raises RefusedError where the distortion is measured on the marks of
    each image.
    """
    summing, size, camera = camera.summing, camera.detector_size_px, camera.unsummed or camera
    optics = optics_of(camera)
    axes = np.array(optics.plane.axes, dtype=np.float64)
    handedness = float(np.linalg.det(axes))
    if handedness < 0:  # CSM's boresight is +Z: the focal plane is seen from behind, its y turned over
        axes = axes * [1.0, -1.0]
    turn = np.diag([1.0, handedness])
    px_from_mm = np.linalg.inv(np.array(optics.plane.mm_from_px)) @ turn
    named = None if handedness < 0 else _named_model(camera)
    model, residual_px = (named, 0.0) if named else _fitted_model(optics, turn)
    focal_length = camera.focal_length_px * optics.pitch_mm
    origin = optics.plane.px(np.zeros(2))
    sensor = _sensor(camera, size, focal_length, px_from_mm, origin, model)
    sensor |= {"detector_sample_summing": summing, "detector_line_summing": summing}
    sensor_from_camera = np.eye(3)
    sensor_from_camera[:2, :2] = axes.T
    return sensor | _geometry(pose, sensor_from_camera, target), residual_px / summing


def _sensor(
    camera: Camera,
    size: tuple[int, int],
    focal_length_mm: float,
    px_from_mm: Array,
    centre_px: Any,
    distortion: dict[str, Any],
) -> dict[str, Any]:
    x, y = (float(value) + 0.5 for value in centre_px)  # CSM's first pixel is centred on 0.5
    return {
        "isis_camera_version": 2,
        "image_lines": size[1],
        "image_samples": size[0],
        "name_platform": camera.mission or camera.name,
        "name_sensor": camera.title or camera.name,
        "reference_height": {"maxheight": 1000, "minheight": -1000, "unit": "m"},
        "name_model": MODEL,
        "detector_sample_summing": 1,
        "detector_line_summing": 1,
        "focal_length_model": {"focal_length": float(focal_length_mm)},
        "detector_center": {"line": y, "sample": x},
        "starting_detector_line": 0,
        "starting_detector_sample": 0,
        "focal2pixel_lines": [0.0, *map(float, px_from_mm[1])],
        "focal2pixel_samples": [0.0, *map(float, px_from_mm[0])],
        "optical_distortion": distortion,
    }


def _geometry(pose: Pose, sensor_from_camera: Array, target: Target) -> dict[str, Any]:
    a, _, c = target.radii_km
    sensor = sensor_from_camera @ pose.camera_from_j2000
    return {
        "center_ephemeris_time": float(pose.et),
        "radii": {"semimajor": a, "semiminor": c, "unit": "km"},
        "naif_keywords": {"BODY_CODE": target.naif_id, f"BODY{target.naif_id}_RADII": list(target.radii_km)},
        "instrument_pointing": _rotation_table(pose.et, sensor, "ck"),
        "body_rotation": _rotation_table(pose.et, pose.body_from_j2000, "ck"),
        "instrument_position": _position_table(pose.et, -pose.target_from_spacecraft_km),
        "sun_position": _position_table(pose.et, pose.sun_from_target_km),
    }


def _rotation_table(et: float, rotation: Array, kind: str) -> dict[str, Any]:
    from scipy.spatial.transform import Rotation

    x, y, z, scalar = Rotation.from_matrix(rotation).as_quat()
    return {
        **_times(et, kind),
        "time_dependent_frames": [J2000],
        "quaternions": [[float(value) for value in (scalar, x, y, z)]],
        "reference_frame": J2000,
        "constant_rotation": np.eye(3).ravel().tolist(),
    }


def _position_table(et: float, position_km: Array) -> dict[str, Any]:
    return {**_times(et, "spk"), "positions": [[float(value) for value in position_km]], "reference_frame": J2000}


def _times(et: float, kind: str) -> dict[str, Any]:
    names = (f"{kind}_table_start_time", f"{kind}_table_end_time")
    return {**dict.fromkeys(names, float(et)), f"{kind}_table_original_size": 1, "ephemeris_times": [float(et)]}


def _named_model(camera: Camera) -> dict[str, Any] | None:
    """CSM's own name for the camera's distortion model, None where it has none."""
    model, given = camera.distortion.model, camera.distortion.parameters
    if model == "none":
        return NOTHING
    if model == "radial-series" and len(given["coefficients"]) <= 3:
        k = [*map(float, given["coefficients"]), *[0.0] * (3 - len(given["coefficients"]))]
        centre = [float(value) for value in given.get("centre_mm", (0.0, 0.0))]
        return {"cahvor": {"coefficients": [*k, *centre]}} if any(centre) else {"radial": {"coefficients": k}}
    if model == "radial-k1":
        return {"radial": {"coefficients": [0.0, -float(given["k1_per_mm2"]), 0.0]}}
    if model == "transverse":
        return {"transverse": {axis: [float(value) for value in given[axis]] for axis in "xy"}}
    if model == "radial-outward" and len(given["coefficients"]) == 2 and not given["coefficients"][0]:
        return {"dawnfc": {"coefficients": [float(given["coefficients"][1])]}}
    if model == "radial-outward" and len(given["coefficients"]) <= 4 and not given["coefficients"][0]:
        k = [*map(float, given["coefficients"]), *[0.0] * (4 - len(given["coefficients"]))]
        f2 = float(camera.focal_length_mm or 0.0) ** 2  # CSM counts r in tangents: k1, k2, p1, p2, k3
        return {"radtan": {"coefficients": [k[1] * f2, k[2] * f2**2, 0.0, 0.0, k[3] * f2**3]}}
    if model == "legendre":
        return {"legendre": {f"{axis}_coefficients": [float(value) for value in given[axis]] for axis in "xy"}}
    return None


def _fitted_model(optics: OpticsModel, turn: Array) -> tuple[dict[str, Any], float]:
    """Cubic polynomials from undistorted to distorted millimetres, fitted over the detector; their largest error in
    pixels."""
    nx, ny = optics.raw_size_px
    raw = np.stack(np.meshgrid(np.linspace(0, nx - 1, GRID), np.linspace(0, ny - 1, GRID)), axis=-1).reshape(-1, 2)
    axes = np.array(optics.plane.axes, dtype=np.float64)
    undistorted = (optics.undistort_points(raw) - optics.centre_px) * optics.pitch_mm @ axes
    distorted = optics.plane.mm(raw)
    known = np.isfinite(undistorted).all(axis=-1)
    if known.sum() < 40:
        fault = f"the distortion {optics.name} has no answer for most of its detector"
        raise RefusedError(Reason.DISTORTION_INVALID, f"{fault}.", "Export the undistorted frame.")
    u, d = undistorted[known] @ turn, distorted[known] @ turn
    scale = float(np.abs(u).max())
    terms = _cubic(u / scale)
    solved, *_ = np.linalg.lstsq(terms, d, rcond=None)
    powers = np.array([0, 1, 1, 2, 2, 2, 3, 3, 3, 3])
    coefficients = solved / scale ** powers[:, None]
    residual_px = float(np.hypot(*(terms @ solved - d).T).max() / optics.pitch_mm)
    return {"transverse": {"x": coefficients[:, 0].tolist(), "y": coefficients[:, 1].tolist()}}, residual_px


def _cubic(p: Points) -> Array:
    x, y = p[..., 0], p[..., 1]
    return np.stack([np.ones_like(x), x, y, x * x, x * y, y * y, x**3, x * x * y, x * y * y, y**3], axis=-1)
