"""New Horizons LORRI FITS: image, error and quality HDUs, and in the header the pose but for the target's attitude.

The pixels' rows grow along +Y of NH_LORRI, which points *up* on the sky (LINE_DISPLAY_DIRECTION = UP in the PDS label):
with y running down, the array in file order would be a mirror image. Rows are therefore reversed, y = 1023 - row.
"""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.camera import known_cameras
from catalog.observation import Quality
from catalog.pose import PartialPose
from catalog.readers.exposure_time import ExposureTime, TimeClaim, checked, claim, exposure_time
from catalog.readers.label_values import number, plain_label, text
from catalog.readers.names import instrument_names, targets_of_label
from catalog.readers.reading import Reading, unreadable
from catalog.readers.stated_mode import UNSTATED, StatedMode, stated_mode

CAMERA_FROM_NH_LORRI = ((1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0))
"""+X sample = +X of the instrument (increasing columns), +Y line = -Y (rows reversed), +Z boresight = -Z: the figures
"LORRI IDL display" of nh_lorri_v201.ti; the header's own WCS agrees (tests/real/test_readers_real.py)."""

QUALITY_BITS = {  # the product's PDS label
    1: Quality.SUSPECT,  # Reed-Solomon error
    2: Quality.SUSPECT,  # defect in a calibration file
    4: Quality.MISSING,  # dead pixel
    8: Quality.SATURATED,
    16: Quality.MISSING,
    32: Quality.MISSING,  # other bad pixel: the frame's first 34 pixels hold housekeeping
}


def matches(header: dict[str, Any]) -> bool:
    """Whether a FITS header is New Horizons LORRI's."""
    return text(header, "HOSTNAME") == "NEW HORIZONS" and str(header.get("INSTRU", "")).strip().lower() == "lor"


def reading(path: Path, header: dict[str, Any], image: NDArray[Any], extensions: dict[str, NDArray[Any]]) -> Reading:
    """Pixels, pose and metadata; FORMAT or SFORMAT says whether pixels are summed 4x4."""
    flags = next((plane for name, plane in extensions.items() if "QUALITY" in name), None)
    errors = next((plane for name, plane in extensions.items() if "ERROR" in name), None)
    exposure_s = number(header, "EXPTIME")
    return Reading(
        format="lorri-fits",
        image=image[::-1],
        quality=None if flags is None else _quality(flags[::-1]),
        noise=None if errors is None else errors[::-1].astype(np.float32),
        instrument_names=instrument_names(header),
        targets=targets_of_label(text(header, "SPCCBTNM") or text(header, "TARGET")),
        time=_time(header),
        exposure_s=exposure_s,
        raw_dn=True,
        stated=_mode(header),
        sources={"camera": "HOSTNAME and INSTRU", "target": "SPCCBTNM or TARGET", "exposure_s": "EXPTIME"},
        label_pose=_pose(path, header),
        flags_from="its extension of quality flags",
        label=plain_label({**header, "ROWS_REVERSED_BY_READER": True}),
    )


def _time(header: dict[str, Any]) -> ExposureTime:
    """SPCSCET (TDB), and the same instant in UTC: calendar day, and day of the year."""
    tdb = number(header, "SPCSCET")
    claims = [] if tdb is None else [checked(TimeClaim("SPCSCET", f"{tdb}", "middle", tdb))]
    for keyword in ("SPCUTCAL", "SPCUTCID"):
        claims += claim(keyword, text(header, keyword), "middle")
    return exposure_time(claims, {"EXPTIME": number(header, "EXPTIME")})


def _mode(header: dict[str, Any]) -> StatedMode:
    stated = stated_mode(header)
    if stated.summing is None and number(header, "FORMAT") == 1:
        return StatedMode(summing=4, source="FORMAT")
    return stated if stated.summing != 1 else UNSTATED


def _quality(flags: NDArray[Any]) -> NDArray[np.uint16]:
    flags = flags.astype(np.int64)
    return np.bitwise_or.reduce([np.where(flags & bit, meaning, 0) for bit, meaning in QUALITY_BITS.items()]).astype(
        np.uint16
    )


def _vector(header: dict[str, Any], keys: tuple[str, ...]) -> NDArray[np.float64] | None:
    values = [number(header, key) for key in keys]
    vector = np.array([np.nan if value is None else value for value in values])
    return vector if np.isfinite(vector).all() and vector.any() else None


def _pose(path: Path, header: dict[str, Any]) -> PartialPose:
    """What the header knows: time, orientation (SPICE quaternion, instrument to J2000), target and Sun vectors.

    The PDS label of the same products says that both vectors are LT+S corrected; its SC_TARGET_POSITION_VECTOR is
    exactly the negative of the header's SPCTSC.
    """
    from scipy.spatial.transform import Rotation

    quaternion = _vector(header, ("SPCQX", "SPCQY", "SPCQZ", "SPCQA"))
    spacecraft = _vector(header, ("SPCTSCX", "SPCTSCY", "SPCTSCZ"))
    if quaternion is not None and abs(np.linalg.norm(quaternion) - 1) > 1e-3:
        raise unreadable(path, f"its quaternion SPCQA..SPCQZ has the length {np.linalg.norm(quaternion):.4g}, not 1")
    j2000_from_instrument = None if quaternion is None else Rotation.from_quat(quaternion).as_matrix()
    return PartialPose(
        et=_time(header).et,
        camera_from_j2000=None if j2000_from_instrument is None else _camera_from_lorri() @ j2000_from_instrument.T,
        target_from_spacecraft_km=None if spacecraft is None else -spacecraft,
        sun_from_target_km=_vector(header, ("SPCTSOX", "SPCTSOY", "SPCTSOZ")),
        **_velocities(header),
    )


def _velocities(header: dict[str, Any]) -> dict[str, Any]:
    """Of spacecraft and target relative to the Sun, which moves by 0.016 km/s about the barycentre at most."""
    spacecraft, sun = (_vector(header, (f"{key}X", f"{key}Y", f"{key}Z")) for key in ("SPCTSCV", "SPCTSOV"))
    if spacecraft is None or sun is None:
        return {}
    return {"spacecraft_velocity_km_s": spacecraft - sun, "target_velocity_km_s": -sun}


def _camera_from_lorri() -> NDArray[np.float64]:
    camera = known_cameras().get("newhorizons-lorri")
    return np.array(camera.camera_from_instrument if camera else CAMERA_FROM_NH_LORRI)
