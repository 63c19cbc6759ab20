"""Simulated images as FITS files that the generic FITS reader understands."""

from pathlib import Path

import numpy as np

from catalog.observation import Observation
from catalog.times import utc_from_et


def write_fits(
    path: Path, observation: Observation, camera: str, target: str, et: float, exposure_s: float, as_bytes: bool
) -> None:
    """Write image, NOISE and QUALITY HDUs. DATE-OBS is mid-exposure, as the reader takes it; as_bytes: 8-bit pixels."""
    from astropy.io import fits

    image = observation.image.astype(np.uint8) if as_bytes else observation.image
    primary = fits.PrimaryHDU(image)
    primary.header["CAMERA"] = camera
    primary.header["TARGET"] = target
    primary.header["DATE-OBS"] = (utc_from_et(et).removesuffix("Z"), "UTC, middle of the exposure")
    primary.header["EXPTIME"] = (exposure_s, "s")
    primary.header["BUNIT"] = "DN"
    primary.header["ORIGIN"] = ("planetpose", "simulated image")
    planes = [fits.ImageHDU(observation.noise, name="NOISE"), fits.ImageHDU(observation.quality, name="QUALITY")]
    planes[1].header["FLAGS"] = ("planetpose", "the bits are those of planetpose's cubes")
    fits.HDUList([primary, *planes]).writeto(path, overwrite=True)
