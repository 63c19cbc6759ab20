"""Reader of FITS images: New Horizons LORRI, this program's own simulations, and any other two-dimensional image.

Of the keywords of any FITS image are read: CAMERA (a catalog name), TARGET or OBJECT, the time of exposure
(`catalog.readers.fits_time`), EXPTIME or XPOSURE, FILTER, UNDISTOR (true: already in the camera's undistorted
geometry). HDUs named NOISE or ERROR (1-sigma) are used when they have the image's shape, and QUALITY when its bits are
this program's `Quality`: its header has FLAGS = 'planetpose', or the file's ORIGIN begins with planetpose. Rows come in
the file's order: the first is line 0, the top.
"""

import re
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.camera import known_cameras
from catalog.errors import RefusedError
from catalog.observation import Quality
from catalog.readers import lorri
from catalog.readers.fits_time import exposure_s, fits_exposure_time
from catalog.readers.label_values import plain_label, text
from catalog.readers.names import instrument_names, targets_of_label
from catalog.readers.reading import Reading, checked_shape, unreadable
from catalog.regular_file import open_regular

MAX_HEADER_BYTES = 2_000_000
MAX_HDUS = 100
BLOCK_BYTES = 2880
NOISE_NAMES = ("NOISE", "ERROR", "ERR", "SIGMA", "UNCERT")
OWN_FLAGS = "planetpose"
FLAG_PLANE = re.compile(r"QUAL|\bDQ\b|\bDQF?\b|MASK|FLAG|BPM|BADPIX")
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
        found = _contents(path)
        if lorri.matches(found.header):
            return lorri.reading(path, found.header, found.image, found.planes)
        return _reading(found)


@dataclass(frozen=True)
class FitsContents:
    """header: of the first image, the primary header's keywords included; comments: of its keywords. planes: the other
    images of its shape by upper-case name; flagged: those whose header says that the bits are this program's."""

    header: dict[str, Any]
    comments: dict[str, str]
    image: NDArray[Any]
    planes: dict[str, NDArray[Any]]
    flagged: frozenset[str]


def _contents(path: Path) -> FitsContents:
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


def _images(path: Path, hdus: Any) -> FitsContents:
    from astropy.io import fits

    header: dict[str, Any] = {}
    comments: dict[str, str] = {}
    image: NDArray[Any] | None = None
    planes: dict[str, NDArray[Any]] = {}
    flagged: set[str] = set()
    for place, hdu in enumerate(hdus):
        if place >= MAX_HDUS:
            raise unreadable(path, f"it has more than {MAX_HDUS} extensions", REMEDY_2D)
        keywords = {key: value for key, value in hdu.header.items() if key not in ("", "COMMENT", "HISTORY")}
        if image is None:
            header = {**header, **keywords}
            comments |= {key: str(hdu.header.comments[key]) for key in keywords}
        if not getattr(hdu, "is_image", False) or hdu.header.get("NAXIS", 0) == 0:
            continue
        if isinstance(hdu, fits.CompImageHDU):
            raise RefusedError("image-compressed", f"image {path}: its FITS image is compressed.", REMEDY_COMPRESSED)
        if image is None:
            image = _plane(path, hdu)
        elif hdu.header.get("NAXIS") == 2 and (hdu.header["NAXIS2"], hdu.header["NAXIS1"]) == image.shape:
            name = hdu.name.upper()
            planes.setdefault(name, _plane(path, hdu))
            if str(hdu.header.get("FLAGS", "")).strip().lower() == OWN_FLAGS:
                flagged.add(name)
    if image is None:
        raise RefusedError("image-not-2d", f"image {path}: this FITS file holds no uncompressed image.", REMEDY_2D)
    return FitsContents(header, comments, image, planes, frozenset(flagged))


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


def _reading(found: FitsContents) -> Reading:
    header, image, extensions = found.header, found.image, found.planes
    camera = (text(header, "CAMERA") or "").lower()
    known = camera in known_cameras()
    noise = next((extensions[name] for name in NOISE_NAMES if name in extensions), None)
    units = (text(header, "BUNIT") or ("DN" if known else "")).upper()
    own, foreign = _own_flags(found)
    undistorted = header.get("UNDISTOR")
    return Reading(
        format="fits",
        image=image,
        quality=_quality(header, image, own),
        noise=None if noise is None else noise.astype(np.float32),
        camera=camera if known else None,
        instrument_names=instrument_names(header),
        targets=targets_of_label(text(header, "TARGET") or text(header, "OBJECT")),
        time=fits_exposure_time(header, found.comments),
        exposure_s=exposure_s(header, "EXPTIME", "XPOSURE"),
        filter=text(header, "FILTER"),
        raw_dn=image.dtype.kind in "iu" or units in ("DN", "ADU", "COUNT", "COUNTS"),
        undistorted=undistorted if isinstance(undistorted, bool) else None,
        label=plain_label(header),
        told=foreign,
        flags_from="its extension QUALITY",
    )


def _own_flags(found: FitsContents) -> tuple[NDArray[Any] | None, tuple[str, ...]]:
    """The plane of this program's quality bits, and a sentence for each plane of flags that is another's."""
    ours = (text(found.header, "ORIGIN") or "").lower().startswith(OWN_FLAGS)
    own = next((name for name in found.planes if name == "QUALITY" and (ours or name in found.flagged)), None)
    foreign = tuple(
        f"the extension {name} is not used: what its flags mean is not known, only those of FLAGS = '{OWN_FLAGS}' are; "
        "give bad pixels with --mask"
        for name in found.planes
        if name != own and FLAG_PLANE.search(name)
    )
    if own and found.planes[own].dtype.kind not in "iu":
        return None, (*foreign, f"the extension {own} is not used: its flags are no whole numbers")
    return (found.planes[own] if own else None), foreign


def _quality(header: dict[str, Any], image: NDArray[Any], flags: NDArray[Any] | None) -> NDArray[np.uint16]:
    bits = np.zeros(image.shape, np.int64)
    if flags is not None and flags.dtype.kind in "iu":
        bits = flags.astype(np.int64) & ALL_BITS
    blank = header.get("BLANK")
    if isinstance(blank, int) and image.dtype.kind in "iu":
        bits = np.where(image == blank, bits | Quality.MISSING, bits)
    return bits.astype(np.uint16)
