"""New Horizons LORRI level 2 FITS: image, error and quality HDUs, and the header that `catalog.readers.lorri` reads."""

from pathlib import Path

import numpy as np

from catalog.times import utc_from_et
from lab.simulate.writers.raw_image import RawImage

SATURATED, MISSING, HOUSEKEEPING = 8, 16, 32
HOUSEKEEPING_PX = 34


def write_lorri(raw: RawImage, path: Path) -> None:
    """Write a frame, its rows upwards as in the real files; the header's pose is `raw.pose` without the target's
    attitude."""
    from astropy.io import fits

    flags = np.where(raw.saturated, SATURATED, 0) | np.where(raw.missing, MISSING, 0)
    flags = flags[::-1].astype(np.int16)
    flags[0, :HOUSEKEEPING_PX] = HOUSEKEEPING
    primary = fits.PrimaryHDU(raw.image[::-1].astype(np.float32))
    primary.header.update(_header(raw))
    error = fits.ImageHDU(raw.noise[::-1].astype(np.float32), name="LORRI Error image")
    quality = fits.ImageHDU(flags, name="LORRI Quality flag image")
    fits.HDUList([primary, error, quality]).writeto(path, overwrite=True)


def _header(raw: RawImage) -> dict[str, object]:
    from scipy.spatial.transform import Rotation

    pose = raw.pose
    camera_from_lorri = np.array(raw.camera.camera_from_instrument)
    x, y, z, a = Rotation.from_matrix(pose.camera_from_j2000.T @ camera_from_lorri).as_quat()
    to_spacecraft, to_sun = -pose.target_from_spacecraft_km, pose.sun_from_target_km
    header: dict[str, object] = {
        "MISSION": "New Horizons",
        "HOSTNAME": "NEW HORIZONS",
        "INSTRU": "lor",
        "EXPTIME": raw.exposure_s,
        "TARGET": raw.target.upper(),
        "SPCCBTNM": raw.target.upper(),
        "SPCSCET": pose.et,
        "SPCUTCAL": utc_from_et(pose.et).removesuffix("Z"),
        "SPCQA": a,
        "SPCQX": x,
        "SPCQY": y,
        "SPCQZ": z,
        "SPCTRANG": pose.range_km,
        "ORIGIN": "planetpose, simulated",
    }
    for name, vector in (("SPCTSC", to_spacecraft), ("SPCTSO", to_sun)):
        header |= {f"{name}{axis}": float(value) for axis, value in zip("XYZ", vector, strict=True)}
    return header
