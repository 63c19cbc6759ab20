"""FITS backplanes: the image as primary array, every plane of the cube as an image extension of the same shape."""

import json
import unicodedata
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from catalog.pose import Pose
from tasks.atomic import file_put_in_place
from tasks.export.source import Source
from tasks.publish.variables import DIMENSIONS, FLAGS, variables_of

if TYPE_CHECKING:
    import xarray as xr
    from astropy.io.fits import Header, ImageHDU

FITS_UNITS = {"degrees_north": "deg", "degrees_east": "deg", "degree": "deg", "km": "km"}
TEXT_LIMIT = 60  # a value that fits on one card
LONGEST = 500  # of comments and history, which are wrapped


def write_backplanes(source: Source, path: Path) -> Path:
    """Write the product as a multi-extension FITS file and return `path`: the cube's planes, and those that
    `planetpose planes` added. EXTNAMEs are their names in capitals; row 1 of the file is the top of the picture, as in
    the cube. Undistorted frames carry the sky's WCS (TAN)."""
    from astropy.io import fits

    primary = fits.PrimaryHDU(source.cube["image"].values)
    _describe(primary.header, source)
    if not source.on_detector:
        _add_sky(primary.header, source)
    planes = []
    for variable in variables_of(source.attributes.get("pixel_space", ""), "body_id" in source.cube):
        if variable.name == "image" or variable.dims != DIMENSIONS:
            continue
        plane = fits.ImageHDU(source.cube[variable.name].values, name=variable.name.upper())
        plane.header["BUNIT"] = FITS_UNITS.get(variable.units, "")
        plane.header.add_comment(_text(variable.long_name, LONGEST))
        if variable.comment:
            plane.header.add_comment(_text(variable.comment, LONGEST))
        if variable.name == "quality":
            plane.header["FLAGS"] = ("planetpose", "the bits are those of planetpose's cubes")
            for flag in FLAGS:
                plane.header.add_comment(f"bit value {int(flag)}: {str(flag.name).lower()}")
        planes.append(plane)
    planes += [_extra_plane(array) for array in source.extra_planes().values()]
    with file_put_in_place(path) as temporary, temporary.open("wb") as file:
        fits.HDUList([primary, *planes]).writeto(file, checksum=True)
    return path


def _extra_plane(array: "xr.DataArray") -> "ImageHDU":
    from astropy.io import fits

    plane = fits.ImageHDU(array.values, name=str(array.name).upper())
    units = str(array.attrs.get("units", ""))
    plane.header["BUNIT"] = FITS_UNITS.get(units, "" if units == "1" else _text(units))
    plane.header.add_comment(_text(array.attrs.get("long_name", ""), LONGEST))
    return plane


def _describe(header: "Header", source: Source) -> None:
    cube, pose = source.attributes, source.pose
    header["OBJECT"] = _text(source.target.name)
    header["INSTRUME"] = _text(source.camera.name)
    header["DATE-OBS"] = (_text(cube["utc"]).removesuffix("Z"), "UTC, middle of the exposure")
    header["TIMESYS"] = "UTC"
    header["ORIGIN"] = _text(cube.get("source", "planetpose"))
    header["PRODUCT"] = _text(source.product)
    header["PIXSPACE"] = (_text(cube.get("pixel_space", "")), "sensor, or resampled (undistorted frame)")
    header["TARGRNG"] = (pose.range_km, "km, spacecraft to target centre")
    header["PHASE"] = (pose.phase_deg, "deg, at the target centre")
    for axis, radius in zip("ABC", source.target.radii_km, strict=True):
        header[f"RADIUS_{axis}"] = (radius, "km, semi-axis of the ellipsoid")
    header["LATTYPE"] = ("planetocentric", "latitude")
    header["LONDIR"] = ("east", "direction of growing longitude")
    header["BODYCRS"] = (_text(source.target.iau_crs or ""), "IAU code of the body")
    header.add_comment("Row 1 is the top of the picture (y of the cube = FITS y - 1, x = FITS x - 1).")
    for key in ("pose_after", "pose_before"):
        if key in cube:
            _add_pose(header, key, Pose.from_dict(json.loads(cube[key])))
    header.add_history(_text(f"exported from the cube of {source.product}", LONGEST))
    provenance = json.loads(cube.get("provenance", "{}"))
    image = provenance.get("image") if isinstance(provenance, dict) else None
    if isinstance(image, dict) and image.get("sha256"):
        header.add_history(_text(f"source image sha256 {image['sha256']}", LONGEST))


def _add_pose(header: "Header", name: str, pose: Pose) -> None:
    for key, value in pose.to_dict().items():
        if key not in ("utc", "et"):
            numbers = ", ".join(f"{number:.15g}" for number in np.ravel(value))
            header.add_history(f"{name}.{key} = {numbers}")


def _add_sky(header: "Header", source: Source) -> None:
    """Right ascension and declination (J2000, apparent: not corrected for the spacecraft's motion) of a pinhole."""
    from astropy.wcs import WCS

    right, down, boresight = source.pose.camera_from_j2000
    right_ascension = np.arctan2(boresight[1], boresight[0])
    declination = np.arcsin(np.clip(boresight[2], -1, 1))
    east = np.array([-np.sin(right_ascension), np.cos(right_ascension), 0.0])
    north = np.cross(boresight, east)
    scale = np.degrees(1.0 / source.camera.focal_length_px)
    wcs: Any = WCS(naxis=2)
    wcs.wcs.ctype = ["RA---TAN", "DEC--TAN"]
    wcs.wcs.crval = [float(np.degrees(right_ascension) % 360), float(np.degrees(declination))]
    wcs.wcs.crpix = [source.camera.centre_px[0] + 1, source.camera.centre_px[1] + 1]
    wcs.wcs.cd = scale * np.array([[east @ right, east @ down], [north @ right, north @ down]])
    wcs.wcs.radesys = "ICRS"
    header.update(wcs.to_header())


def _text(value: object, limit: int = TEXT_LIMIT) -> str:
    """Printable ASCII of at most `limit` characters, all that a FITS header may hold: letters lose their accents, and
    what has no like in ASCII becomes a question mark."""
    plain = unicodedata.normalize("NFKD", str(value))
    kept = "".join(character for character in plain if not unicodedata.combining(character))
    ascii_only = kept.encode("ascii", "replace").decode()
    return "".join(character if character.isprintable() else "?" for character in ascii_only)[:limit]
