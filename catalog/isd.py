"""Image support data (ISD, JSON) of USGS' Abstraction Layer for Ephemerides (ALE): camera and pose of one image.

Conventions: the centre of the first pixel is (0.5, 0.5); focal2pixel_samples and _lines lead from millimetres of the
focal plane to detector pixels beyond detector_center; quaternions have the scalar first and lead from J2000 to a moving
frame, from which constant_rotation leads to the sensor's or the body's; positions are kilometres from the target's
centre, in J2000. USGSCSM's own form (sensor_position, sensor_orientation) is body-fixed, in metres.

A detector_center of (0, 0) or with a negative number states none (ALE's drivers for Viking, LORRI and MVIC); a sole
radial coefficient is ISIS' K1 (Galileo SSI), xu = xd (1 + K1 r^2).
"""

import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.body import Target
from catalog.carried_tables import Positions, Rotations, matrix
from catalog.errors import RefusedError
from catalog.instrument_kernel import Instrument, TablePool
from catalog.kernel_camera import SMALLEST_FOCAL_LENGTH_MM, undistorted_frame
from catalog.kernel_frames import handedness_of
from catalog.plain_files import read_json_file
from catalog.pose import PartialPose
from catalog.reasons import Reason
from catalog.rotation import nearest_rotation

Array = NDArray[np.float64]
NEEDED = ("focal2pixel_samples", "focal2pixel_lines", "focal_length_model", "image_samples", "image_lines")
LIGHT_KM_PER_S = 299792.458
REMEDY = "Give an ISD of a frame camera, as ALE's isd_generate writes them."
FAULTS = (KeyError, TypeError, ValueError, IndexError, AttributeError, OverflowError)


def is_isd(content: Any) -> bool:
    """Whether JSON content is an ISD."""
    return isinstance(content, dict) and "name_model" in content and "focal2pixel_lines" in content


def content_from_isd(path: Path) -> dict[str, Any]:
    """Content of a camera file for an ISD: of its whole detector, so that images summed or cut keep their modes.

    Raises RefusedError naming the file and what is wrong or missing, and for sensors that are no frame cameras.
    """
    content = _read(path)
    _refuse_other_sensors(path, content)
    try:
        return _camera_content(path, content)
    except FAULTS as error:
        raise _invalid(path, error) from error


def pose_from_isd(path: Path, target: Target | None = None) -> PartialPose:
    """Pose of an ISD at its center_ephemeris_time. Raises RefusedError naming the file and what is wrong or missing.

    target: of ISDs whose positions are body-fixed (sensor_position, sensor_orientation: USGSCSM's own form), which its
    rotation model brings to J2000.
    """
    content = _read(path)
    try:
        return _body_fixed_pose(path, content, target) if "sensor_orientation" in content else _pose(path, content)
    except FAULTS as error:
        raise _invalid(path, error) from error


def _read(path: Path) -> dict[str, Any]:
    try:
        content = read_json_file(path)
    except (OSError, ValueError) as error:
        raise RefusedError(Reason.ISD_UNREADABLE, f"ISD {path} cannot be read ({error}).", REMEDY) from error
    if not isinstance(content, dict) or not is_isd(content):
        raise RefusedError(
            Reason.ISD_INVALID, f"file {path} is no ISD: it lacks name_model or focal2pixel_lines.", REMEDY
        )
    return content


def _invalid(path: Path, error: Exception) -> RefusedError:
    fault = f"it lacks {error}" if isinstance(error, KeyError) else str(error)
    return RefusedError(Reason.ISD_INVALID, f"ISD {path}: {fault}.", REMEDY)


def _refuse_other_sensors(path: Path, content: dict[str, Any]) -> None:
    model = str(content["name_model"])
    if "FRAME_SENSOR" not in model.upper() or "PUSH" in model.upper():
        fault = f"ISD {path} is of a {model}: its lines have times and poses of their own."
        raise RefusedError(Reason.LINE_SCANNER, fault, "Give an ISD of a frame camera (USGS_ASTRO_FRAME_SENSOR_MODEL).")


def _camera_content(path: Path, content: dict[str, Any]) -> dict[str, Any]:
    samples, lines = (np.array(content[f"focal2pixel_{each}"], dtype=np.float64) for each in ("samples", "lines"))
    mm_from_px = np.linalg.inv(np.array([samples[1:], lines[1:]]))
    offset = -mm_from_px @ np.array([samples[0], lines[0]])
    size = _detector_size(content)
    focal_length = float(content["focal_length_model"]["focal_length"])
    focal_length *= 1e3 if focal_length < SMALLEST_FOCAL_LENGTH_MM else 1.0
    origin, centre_from = _origin(content, size)
    keywords = _instrument(path, content)
    placed = undistorted_frame(mm_from_px, offset, origin, size, handedness_of(keywords) if keywords else 1)
    pitch = placed["pixel_pitch_mm"]
    name = re.sub(r"[^A-Za-z0-9]+", "-", f"{content.get('name_platform', '')}-{content.get('name_sensor', 'isd')}")
    return placed | {
        "name": name.strip("-").lower() or "isd",
        "title": f"{content.get('name_sensor', 'sensor')} of {path.name}",
        "mission": str(content.get("name_platform", "")),
        "focal_length_mm": focal_length,
        "distortion": _distortion(content.get("optical_distortion") or {}, 0.5 * pitch * np.array(size)),
        "sources": (
            f"ISD {path.name} (ALE, camera version {content.get('isis_camera_version', 'unknown')})",
            centre_from,
        ),
        "tried": "made from an ISD; not tried on images by this program",
    }


def _detector_size(content: dict[str, Any]) -> tuple[int, int]:
    """Samples and lines of the detector, as far as the image shows it."""
    return tuple(  # type: ignore[return-value]
        int(content.get(f"starting_detector_{one}", 0))
        + int(content[f"image_{one}s"]) * max(1, int(content.get(f"detector_{one}_summing", 1)))
        for one in ("sample", "line")
    )


def _origin(content: dict[str, Any], size: tuple[int, int]) -> tuple[Array, str]:
    centre = content.get("detector_center") or {}
    pixel = np.array([float(centre.get("sample", 0.0)), float(centre.get("line", 0.0))])
    if (pixel > 0).all():
        return pixel - 0.5, "detector_center"
    return np.array(size) / 2.0 - 0.5, "the middle of the detector: detector_center states none"


def _instrument(path: Path, content: dict[str, Any]) -> Instrument | None:
    """The instrument of the ISD's NAIF keywords."""
    keywords = content.get("naif_keywords") or {}
    ids = [int(found[1]) for key in keywords if (found := re.match(r"INS(-\d+)_BORESIGHT$", key))]
    chain = (content.get("instrument_pointing") or {}).get("constant_frames") or []
    naif_id = next((each for each in chain if each in ids), ids[0] if ids else None)
    return None if naif_id is None else Instrument(naif_id, str(naif_id), TablePool(keywords, path.name))


def _distortion(given: dict[str, Any], half_mm: Array) -> dict[str, Any]:
    """[distortion] of CSM's models, named in the ISD by one key."""
    if not given:
        return {"model": "none"}
    name, values = next(iter(given.items()))
    if name == "transverse":
        return {"model": "transverse", "x": values["x"], "y": values["y"]}
    if name == "legendre":
        half = half_mm.tolist()
        return {"model": "legendre", "x": values["x_coefficients"], "y": values["y_coefficients"], "half_mm": half}
    k = [float(value) for value in values["coefficients"]] if "coefficients" in values else []
    if name == "radial" and k:
        k = [0.0, -k[0]] if len(k) == 1 else k
        return {"model": "radial-series", "coefficients": k} if any(k) else {"model": "none"}
    if name == "dawnfc" and k:
        return {"model": "radial-outward", "coefficients": [0.0, k[0]]}
    if name == "cahvor" and len(k) == 5:
        return {"model": "radial-series", "coefficients": k[:3], "centre_mm": k[3:]}
    if name == "radtan" and len(k) == 5:
        return {"model": "radial-tangential", "coefficients": k}
    raise ValueError(f"its distortion {name!r} with {len(k)} coefficients is not known")


def _pose(path: Path, content: dict[str, Any]) -> PartialPose:
    et = float(content["center_ephemeris_time"])
    camera_from_sensor = np.array(content_from_isd(path)["camera_from_instrument"], dtype=np.float64)
    sensor = _rotations(content["instrument_pointing"]).at(et)
    spacecraft, sun = (_positions(content[name]).at(et) for name in ("instrument_position", "sun_position"))
    return PartialPose(
        et=et,
        camera_from_j2000=camera_from_sensor @ sensor,
        target_from_spacecraft_km=-spacecraft,
        sun_from_target_km=sun,
        body_from_j2000=_rotations(content["body_rotation"]).at(et),
    )


def _body_fixed_pose(path: Path, content: dict[str, Any], target: Target | None) -> PartialPose:
    """Quaternions (x, y, z, scalar) lead from the sensor's frame to the body's, positions from the body's centre."""
    from scipy.spatial.transform import Rotation

    et = float(content["center_ephemeris_time"])
    if target is None or target.rotation is None:
        raise ValueError("its positions are body-fixed, and no target with a rotation model is known")
    spacecraft, sun = (_body_fixed_km(content[name]) for name in ("sensor_position", "sun_position"))
    body = target.rotation.body_from_j2000(et - float(np.linalg.norm(spacecraft)) / LIGHT_KM_PER_S)
    quaternions = np.array(content["sensor_orientation"]["quaternions"], dtype=np.float64).reshape(-1, 4)
    body_from_sensor = Rotation.from_quat(quaternions[len(quaternions) // 2]).as_matrix()
    camera_from_sensor = np.array(content_from_isd(path)["camera_from_instrument"], dtype=np.float64)
    return PartialPose(
        et=et,
        camera_from_j2000=nearest_rotation(camera_from_sensor @ body_from_sensor.T @ body),
        target_from_spacecraft_km=-body.T @ spacecraft,
        sun_from_target_km=body.T @ sun,
        body_from_j2000=body,
    )


def _body_fixed_km(table: dict[str, Any]) -> Array:
    places = np.array(table["positions"], dtype=np.float64).reshape(-1, 3)
    return places[len(places) // 2] * (1e-3 if table.get("unit", "m") == "m" else 1.0)


def _rotations(table: dict[str, Any]) -> Rotations:
    times = np.array(table["ephemeris_times"], dtype=np.float64)
    quaternions = np.array(table["quaternions"], dtype=np.float64).reshape(len(times), 4)
    return Rotations(times, quaternions, matrix(table.get("constant_rotation")))


def _positions(table: dict[str, Any]) -> Positions:
    times = np.array(table["ephemeris_times"], dtype=np.float64)
    if table.get("reference_frame", 1) != 1:
        raise ValueError(f"its positions are in reference frame {table['reference_frame']}, J2000 (1) is needed")
    velocities = table.get("velocities")
    moving = None if not velocities else np.array(velocities, dtype=np.float64).reshape(len(times), 3)
    return Positions(times, np.array(table["positions"], dtype=np.float64).reshape(len(times), 3), moving)
