"""Reader of FITS images: New Horizons LORRI, this program's own simulations, and any other image, tile-compressed too.

Of the keywords of any FITS image are read: CAMERA (a catalog name), TARGET or OBJECT, the time of exposure
(`catalog.readers.fits_time`), EXPTIME or XPOSURE, FILTER, UNDISTOR (true: already in the camera's undistorted
geometry). HDUs named NOISE or ERROR (1-sigma) are used when they have the image's shape, and QUALITY when its bits are
this program's `Quality`: its header has FLAGS = 'planetpose', or the file's ORIGIN begins with planetpose. Rows come in
the file's order: the first is line 0, the top.
"""

import re
import struct
import warnings
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.camera import known_cameras
from catalog.errors import RefusedError
from catalog.observation import Quality
from catalog.readers import lorri
from catalog.readers.bands import chosen_plane
from catalog.readers.fits_tiles import check_tiles, tile_faults
from catalog.readers.fits_time import exposure_s, fits_exposure_time
from catalog.readers.label_values import number, plain_label, text
from catalog.readers.names import instrument_names, targets_of_label
from catalog.readers.reading import Reading, checked_shape, unreadable
from catalog.readers.stated_mode import mode_of_fits_header
from catalog.reasons import Reason
from catalog.regular_file import open_regular

MAX_HEADER_BYTES = 2_000_000
MAX_HDUS = 100
BLOCK_BYTES = 2880
EXTENSION = b"XTENSION"
NOISE_NAMES = ("NOISE", "ERROR", "ERR", "SIGMA", "UNCERT")
TARGETS = ("TARGET", "TARGNAME", "OBJECT", "TARGET_NAME")
GAINS = ("GAIN", "CCDGAIN", "EGAIN")
OWN_FLAGS = "planetpose"
FLAG_PLANE = re.compile(r"QUAL|\bDQ\b|\bDQF?\b|MASK|FLAG|BPM|BADPIX")
ALL_BITS = sum(Quality)
REMEDY_2D = "Give a file with a two-dimensional image."
MAX_PLANES = 10_000
DAMAGE = (
    OSError, ValueError, TypeError, LookupError, AttributeError, ArithmeticError, EOFError, RuntimeError, zlib.error,
    re.error, struct.error,
)  # fmt: skip
"""What astropy raises for damaged files, beside errors of its own."""


class FitsReader:
    """Every FITS file whose first image is two-dimensional."""

    def recognises(self, head: bytes, path: Path) -> bool:  # noqa: ARG002
        """A FITS file begins with SIMPLE  =."""
        return head.startswith(b"SIMPLE  =")

    def read(self, path: Path, plane: str | None = None) -> Reading:
        """Pixels and metadata of a FITS image."""
        found = _contents(path, plane)
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


def _contents(path: Path, plane: str | None) -> FitsContents:
    from astropy.io import fits

    with open_regular(path) as file:
        if b"END" + b" " * 77 not in file.read(MAX_HEADER_BYTES):
            raise unreadable(path, "its FITS header has no END card")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            with open_regular(path) as file, fits.open(file, memmap=False, lazy_load_hdus=True) as hdus:
                return _images(path, hdus, plane)
    except (*DAMAGE, fits.VerifyError) as error:
        raise unreadable(path, f"no sound FITS file ({error})") from error


def _images(path: Path, hdus: Any, plane: str | None) -> FitsContents:
    found: list[Any] = []
    for place, hdu in enumerate(_extensions(path, hdus)):
        if place >= MAX_HDUS:
            raise unreadable(path, f"it has more than {MAX_HDUS} extensions", REMEDY_2D)
        if getattr(hdu, "is_image", False) and hdu.header.get("NAXIS", 0) > 0:
            found.append(hdu)
    if not found:
        raise RefusedError(Reason.IMAGE_NOT_2D, f"image {path}: this FITS file holds no image.", REMEDY_2D)
    counts = [_plane_count(path, hdu) for hdu in found]
    everything = [(hdu, number) for hdu, count in zip(found, counts, strict=True) for number in range(count)]
    names = _plane_names(found, counts) if len(everything) > 1 else [""]
    chosen, number = everything[chosen_plane(path, names, plane, 0 if counts[0] == 1 else None)]
    header, comments = _keywords(hdus[0]), _comments(hdus[0])
    if chosen is not hdus[0]:
        header, comments = {**header, **_keywords(chosen)}, {**comments, **_comments(chosen)}
    image = _plane(path, chosen, number)
    planes: dict[str, NDArray[Any]] = {}
    flagged: set[str] = set()
    for hdu, count in zip(found, counts, strict=True):
        if hdu is not chosen and count == 1 and _size(hdu) == image.shape:
            planes.setdefault(hdu.name.upper(), _plane(path, hdu, 0))
            if str(hdu.header.get("FLAGS", "")).strip().lower() == OWN_FLAGS:
                flagged.add(hdu.name.upper())
    return FitsContents(header, comments, image, planes, frozenset(flagged))


def _extensions(path: Path, hdus: Any) -> Iterator[Any]:
    """The file's HDUs, until something follows that does not begin as one."""
    for place in range(MAX_HDUS + 1):
        try:
            hdu = hdus[place]
        except IndexError:
            return
        except OSError:
            if place == 0 or _begins_an_extension(path, hdus[place - 1].fileinfo()):
                raise
            return
        yield hdu


def _begins_an_extension(path: Path, before: dict[str, int]) -> bool:
    with open_regular(path) as file:
        file.seek(before["datLoc"] + before["datSpan"])
        return file.read(len(EXTENSION)) == EXTENSION


def _keywords(hdu: Any) -> dict[str, Any]:
    return {key: value for key, value in hdu.header.items() if key not in ("", "COMMENT", "HISTORY")}


def _comments(hdu: Any) -> dict[str, str]:
    return {key: str(hdu.header.comments[key]) for key in _keywords(hdu)}


def _axes(path: Path, hdu: Any) -> list[int]:
    """Lengths of the axes, the fastest first."""
    axes = [hdu.header[f"NAXIS{axis + 1}"] for axis in range(hdu.header["NAXIS"])]
    if not all(type(axis) is int and axis >= 0 for axis in axes):
        raise unreadable(path, f"its axes are {axes}")
    if len(axes) < 2:
        raise RefusedError(Reason.IMAGE_NOT_2D, f"image {path}: its image has {len(axes)} axis ({axes}).", REMEDY_2D)
    return axes


def _size(hdu: Any) -> tuple[int, int]:
    return hdu.header["NAXIS2"], hdu.header["NAXIS1"]


def _plane_count(path: Path, hdu: Any) -> int:
    count = prod(_axes(path, hdu)[2:])
    if not 1 <= count <= MAX_PLANES:
        raise RefusedError(Reason.IMAGE_NOT_2D, f"image {path}: its axes are {_axes(path, hdu)}.", REMEDY_2D)
    return count


def _plane_names(found: list[Any], counts: list[int]) -> list[str]:
    """NAME, or NAME:NUMBER (from 1) in a cube; an extension without a name has only its place among all planes."""
    return [
        hdu.name + (f":{number + 1}" if count > 1 and hdu.name else "")
        for hdu, count in zip(found, counts, strict=True)
        for number in range(count)
    ]


def _plane(path: Path, hdu: Any, number: int) -> NDArray[Any]:
    from astropy.io import fits

    axes = _axes(path, hdu)
    lines, samples = checked_shape(path, axes[1], axes[0])
    packed = isinstance(hdu, fits.CompImageHDU)
    item_bytes = abs(int(hdu.header["BITPIX"])) // 8
    place = hdu.fileinfo()
    end = place["datLoc"] + (place["datSpan"] if packed else prod(axes) * item_bytes)
    size = path.stat().st_size
    if end > size:
        raise unreadable(path, f"truncated: its pixels should reach byte {end}, the file has {size}")
    _check_end(path, end)
    if packed:
        check_tiles(path, hdu, axes)
    which = np.unravel_index(number, axes[:1:-1]) if len(axes) > 2 else ()
    if packed and len(axes) > 2:
        checked_shape(path, lines, samples * prod(axes[2:]))
    data = np.asarray(_numbers(path, hdu, tuple(int(i) for i in which)))
    if data.size != lines * samples or data.dtype.kind not in "iuf":
        raise unreadable(path, f"its pixels have the shape {data.shape} and type {data.dtype}")
    return data.reshape(lines, samples)


def _numbers(path: Path, hdu: Any, which: tuple[int, ...]) -> Any:
    try:
        return hdu.section[which] if which else hdu.data
    except tile_faults() as error:
        raise unreadable(path, f"its tiles are damaged ({error})") from error


def _check_end(path: Path, end: int) -> None:
    """Refuse a file in which bytes were lost or put in, so that the picture is shifted. end: of its pixels.

    Behind them comes nothing, or zeros up to the block's end, and then nothing, another extension, or what is no part
    of the file any more: whole blocks, or bytes that some writer added (NEAR's files end with a line feed). Where the
    zeros go on behind the block, as they do when bytes were put in among a sky of zeros, they are no such bytes."""
    size = path.stat().st_size
    block_end = -(-end // BLOCK_BYTES) * BLOCK_BYTES
    if size == end:
        return
    lost_or_put_in = unreadable(path, f"its {size} bytes are no whole FITS blocks: bytes were lost or put in")
    if size < block_end:
        raise lost_or_put_in
    with open_regular(path) as file:
        file.seek(end)
        fill, beyond = file.read(block_end - end), file.read(BLOCK_BYTES)
    if not beyond or beyond.startswith(EXTENSION) or size % BLOCK_BYTES == 0:
        return
    if any(fill) or (len(beyond) > 1 and not any(beyond)):
        raise lost_or_put_in


def _reading(found: FitsContents) -> Reading:
    header, image, extensions = found.header, found.image, found.planes
    camera = (text(header, "CAMERA") or "").lower()
    known = camera in known_cameras()
    noise = next((extensions[name] for name in NOISE_NAMES if name in extensions), None)
    units = (text(header, "BUNIT") or ("DN" if known else "")).upper()
    own, foreign = _own_flags(found)
    target_key = next((key for key in TARGETS if targets_of_label(text(header, key))), None)
    mode = mode_of_fits_header(header)
    gain_key = next((key for key in GAINS if text(header, key)), None)
    sources = {"target": target_key, "camera": "CAMERA" if known else None, "mode": mode.source, "gain": gain_key}
    undistorted = header.get("UNDISTOR")
    return Reading(
        format="fits",
        image=image,
        quality=_quality(header, image, own),
        noise=None if noise is None else noise.astype(np.float32),
        camera=camera if known else None,
        instrument_names=instrument_names(header),
        targets=targets_of_label(text(header, target_key)) if target_key else (),
        time=fits_exposure_time(header, found.comments),
        exposure_s=exposure_s(header, "EXPTIME", "XPOSURE"),
        filter=text(header, "FILTER"),
        stated=mode,
        gain=text(header, gain_key) if gain_key else None,
        sources={what: source for what, source in sources.items() if source},
        raw_dn=image.dtype.kind in "iu" or units in ("DN", "ADU", "COUNT", "COUNTS"),
        undistorted=undistorted if isinstance(undistorted, bool) else None,
        label=plain_label(header),
        remarks=(*foreign, *_other_images(found)),
        flags_from="its extension QUALITY",
    )


def _other_images(found: FitsContents) -> tuple[str, ...]:
    others = [name for name in found.planes if name not in (*NOISE_NAMES, "QUALITY") and not FLAG_PLANE.search(name)]
    return (f"the file's other images ({', '.join(others)}) are not used; --plane NAME takes one",) if others else ()


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
    blank, zero = header.get("BLANK"), number(header, "BZERO") or 0.0
    if isinstance(blank, int) and image.dtype.kind in "iu":  # BLANK is a stored number: unsigned ones have a BZERO
        bits = np.where(image == blank + int(zero), bits | Quality.MISSING, bits)
    return bits.astype(np.uint16)
