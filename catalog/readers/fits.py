"""Reader of FITS images: New Horizons LORRI, this program's own simulations, and any other two-dimensional image.

Of the keywords of any FITS image are read: CAMERA (a catalog name), TARGET or OBJECT, DATE-AVG, DATE-MID or DATE-OBS
(taken as the middle of the exposure), EXPTIME (seconds), FILTER, UNDISTOR (true: already in the camera's undistorted
geometry). HDUs named NOISE or ERROR (1-sigma) and QUALITY (this program's `Quality` bits) are used when they have the
image's shape. Rows come in the file's order: the first is line 0, the top.
"""

import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.camera import known_cameras
from catalog.errors import RefusedError
from catalog.observation import Quality
from catalog.readers import lorri
from catalog.readers.label_values import et, number, plain_label, text
from catalog.readers.names import instrument_names, target_of_label
from catalog.readers.reading import Reading, checked_shape, unreadable
from catalog.regular_file import open_regular

MAX_HEADER_BYTES = 2_000_000
MAX_HDUS = 100
BLOCK_BYTES = 2880
NOISE_NAMES = ("NOISE", "ERROR", "ERR", "SIGMA", "UNCERT")
ALL_BITS = sum(Quality)
REMEDY_COMPRESSED = "Unpack it, for example with `funpack`."
REMEDY_2D = "Give a file with one two-dimensional image."


class FitsReader:
    """Every FITS file whose first image is two-dimensional."""

    def recognises(self, head: bytes, path: Path) -> bool:  # noqa: ARG002
        """A FITS file begins with SIMPLE  =."""
        return head.startswith(b"SIMPLE  =")

    def read(self, path: Path) -> Reading:
        """Pixels and metadata of a FITS image."""
        header, image, extensions = _contents(path)
        if lorri.matches(header):
            return lorri.reading(path, header, image, extensions)
        return _reading(header, image, extensions)


def _contents(path: Path) -> tuple[dict[str, Any], NDArray[Any], dict[str, NDArray[Any]]]:
    """Header and pixels of the first image HDU (the primary header's keywords included), and its companions."""
    from astropy.io import fits

    with open_regular(path) as file:
        if b"END" + b" " * 77 not in file.read(MAX_HEADER_BYTES):
            raise unreadable(path, "its FITS header has no END card")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            with open_regular(path) as file, fits.open(file, memmap=False, lazy_load_hdus=True) as hdus:
                return _images(path, hdus)
    except (OSError, ValueError, TypeError, KeyError, IndexError, AttributeError, fits.VerifyError) as error:
        raise unreadable(path, f"no sound FITS file ({error})") from error


def _images(path: Path, hdus: Any) -> tuple[dict[str, Any], NDArray[Any], dict[str, NDArray[Any]]]:
    from astropy.io import fits

    header: dict[str, Any] = {}
    image: NDArray[Any] | None = None
    extensions: dict[str, NDArray[Any]] = {}
    for place, hdu in enumerate(hdus):
        if place >= MAX_HDUS:
            raise unreadable(path, f"it has more than {MAX_HDUS} extensions", REMEDY_2D)
        keywords = {key: value for key, value in hdu.header.items() if key not in ("", "COMMENT", "HISTORY")}
        if image is None:
            header = {**header, **keywords}
        if not getattr(hdu, "is_image", False) or hdu.header.get("NAXIS", 0) == 0:
            continue
        if isinstance(hdu, fits.CompImageHDU):
            raise RefusedError("image-compressed", f"image {path}: its FITS image is compressed.", REMEDY_COMPRESSED)
        if image is None:
            image = _plane(path, hdu)
        elif hdu.header.get("NAXIS") == 2 and (hdu.header["NAXIS2"], hdu.header["NAXIS1"]) == image.shape:
            extensions[hdu.name.upper()] = _plane(path, hdu)
    if image is None:
        raise RefusedError("image-not-2d", f"image {path}: this FITS file holds no uncompressed image.", REMEDY_2D)
    return header, image, extensions


def _plane(path: Path, hdu: Any) -> NDArray[Any]:
    axes = [hdu.header[f"NAXIS{axis + 1}"] for axis in range(hdu.header["NAXIS"])]
    while len(axes) > 2 and axes[-1] == 1:
        axes.pop()
    if len(axes) != 2:
        raise RefusedError("image-not-2d", f"image {path}: it has {len(axes)} axes ({axes}).", REMEDY_2D)
    if not all(isinstance(axis, int) for axis in axes):
        raise unreadable(path, f"its axes are {axes}")
    lines, samples = checked_shape(path, axes[1], axes[0])
    end = hdu.fileinfo()["datLoc"] + lines * samples * abs(int(hdu.header["BITPIX"])) // 8
    if end > path.stat().st_size:
        raise unreadable(path, f"truncated: its pixels should reach byte {end}, the file has {path.stat().st_size}")
    if path.stat().st_size % BLOCK_BYTES and end != path.stat().st_size:
        raise unreadable(path, f"its {path.stat().st_size} bytes are no whole FITS blocks: bytes were lost or put in")
    data = np.asarray(hdu.data)
    if data.size != lines * samples or data.dtype.kind not in "iuf":
        raise unreadable(path, f"its pixels have the shape {data.shape} and type {data.dtype}")
    return data.reshape(lines, samples)


def _reading(header: dict[str, Any], image: NDArray[Any], extensions: dict[str, NDArray[Any]]) -> Reading:
    camera = (text(header, "CAMERA") or "").lower()
    known = camera in known_cameras()
    noise = next((extensions[name] for name in NOISE_NAMES if name in extensions), None)
    units = (text(header, "BUNIT") or ("DN" if known else "")).upper()
    date = text(header, "DATE-AVG") or text(header, "DATE-MID") or text(header, "DATE-OBS")
    undistorted = header.get("UNDISTOR")
    return Reading(
        format="fits",
        image=image,
        quality=_quality(header, image, extensions.get("QUALITY")),
        noise=None if noise is None else noise.astype(np.float32),
        camera=camera if known else None,
        instrument_names=instrument_names(header),
        target=target_of_label(text(header, "TARGET") or text(header, "OBJECT")),
        et=et(date),
        exposure_s=number(header, "EXPTIME"),
        filter=text(header, "FILTER"),
        raw_dn=image.dtype.kind in "iu" or units in ("DN", "ADU", "COUNT", "COUNTS"),
        undistorted=undistorted if isinstance(undistorted, bool) else None,
        label=plain_label(header),
    )


def _quality(header: dict[str, Any], image: NDArray[Any], flags: NDArray[Any] | None) -> NDArray[np.uint16]:
    bits = np.zeros(image.shape, np.int64)
    if flags is not None and flags.dtype.kind in "iu":
        bits = flags.astype(np.int64) & ALL_BITS
    blank = header.get("BLANK")
    if isinstance(blank, int) and image.dtype.kind in "iu":
        bits = np.where(image == blank, bits | Quality.MISSING, bits)
    return bits.astype(np.uint16)
