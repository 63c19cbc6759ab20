"""Reader of grey TIFF pictures of every depth and layout, by GDAL: Pillow wraps 32-bit numbers and inverts.

The numbers are the file's: 1 to 64 bits, signed, unsigned or floating, whatever byte order, compression, strips or
tiles. Where the file says that zero is white, brightness is the largest number minus the file's. Pixels of strips that
were never written, and of GDAL's no-data value, are MISSING.
"""

import struct
import warnings
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.errors import RefusedError
from catalog.observation import Quality
from catalog.readers.reading import Reading, checked_shape, unreadable
from catalog.regular_file import read_regular

MAGIC = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
REMEDY_GREY = "Give one grey channel: whole numbers of up to 32 bits or floats, for example by `gdal_translate -b 1`."
SUBFILE_TAG, PHOTOMETRIC_TAG, ORIENTATION_TAG = 254, 262, 274
REDUCED_OR_MASK = 1 | 4
LONG = 4
WHITE_IS_ZERO, PALETTE = 0, 3
MAX_TAGS = 4000
MAX_BLOCKS = 1_000_000
MAX_DIRECTORIES = 50


class TiffReader:
    """TIFF and BigTIFF."""

    def recognises(self, head: bytes, path: Path) -> bool:  # noqa: ARG002
        """The byte order, and 42 or 43."""
        return head.startswith(MAGIC)

    def read(self, path: Path) -> Reading:
        """Pixels of a grey picture. Raises RefusedError for colour, several bands or pages, and damage."""
        from rasterio._err import CPLE_BaseError  # what properties of a damaged file raise
        from rasterio.errors import RasterioError
        from rasterio.io import MemoryFile

        content = read_regular(path)  # from memory: GDAL neither sees the path's syntax nor the files beside it
        tags = _first_directory(path, content)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                with MemoryFile(content) as file, file.open(driver="GTiff") as picture:
                    pixels, quality = _grey_pixels(path, picture, tags.get(PHOTOMETRIC_TAG, 1))
        except (RasterioError, CPLE_BaseError, OSError, ValueError, TypeError, LookupError, ArithmeticError) as error:
            raise unreadable(path, f"no sound TIFF ({' '.join(str(error).split())})") from error
        turn = tags.get(ORIENTATION_TAG, 1)
        return Reading(
            format="picture",
            image=_upright(pixels, turn),
            quality=_upright(quality, turn),
            raw_dn=pixels.dtype.kind in "iu",
        )


def _grey_pixels(path: Path, picture: Any, photometric: int) -> tuple[NDArray[Any], NDArray[np.uint16]]:
    checked_shape(path, picture.height, picture.width)
    kind = str(picture.dtypes[0])
    tags = picture.tags(ns="IMAGE_STRUCTURE") | picture.tags(1, ns="IMAGE_STRUCTURE")
    white_is_zero = photometric == WHITE_IS_ZERO
    roles = [role.name for role in picture.colorinterp]
    if picture.count != 1 or photometric == PALETTE:
        found = f"bands {', '.join(roles)}" if picture.count > 1 else "colours of a palette"
        fault = f"image {path}: a TIFF of {picture.count} bands, {kind} ({found}), mixes exposures."
        raise RefusedError("image-colour", fault, REMEDY_GREY)
    if np.dtype(kind).kind not in "iuf" or (white_is_zero and np.dtype(kind).kind != "u"):
        zero = " whose zero is white" if white_is_zero else ""
        raise RefusedError(
            "image-colour", f"image {path}: TIFF numbers of type {kind}{zero} are not read.", REMEDY_GREY
        )
    pixels = picture.read(1)
    missing = _never_written(path, picture)
    if picture.nodata is not None:
        missing |= pixels == picture.nodata
    if white_is_zero:
        bits = int(tags.get("NBITS", np.dtype(kind).itemsize * 8))
        pixels = np.asarray((1 << bits) - 1 - pixels.astype(np.uint64)).astype(kind)
    return pixels, np.where(missing, Quality.MISSING, 0).astype(np.uint16)


def _never_written(path: Path, picture: Any) -> NDArray[np.bool_]:
    """Mask (ny, nx) of strips and tiles that the file has no bytes for, which GDAL reads as zeros."""
    missing = np.zeros((picture.height, picture.width), bool)
    high, wide = picture.block_shapes[0]
    rows, columns = -(-picture.height // high), -(-picture.width // wide)
    if rows * columns > MAX_BLOCKS:
        raise unreadable(path, f"it has {rows * columns} strips or tiles")
    for row in range(rows):
        for column in range(columns):
            if not int(picture.get_tag_item(f"BLOCK_OFFSET_{column}_{row}", "TIFF", bidx=1) or 0):
                missing[row * high : (row + 1) * high, column * wide : (column + 1) * wide] = True
    return missing


def _directories(content: bytes) -> Iterator[dict[int, int]]:
    """Of each picture in the file, in order, the first value of its tags of short numbers: what GDAL does not tell."""
    order = "<" if content[:2] == b"II" else ">"
    big = content[2:4] in (b"+\0", b"\0+")
    word, counter, entry_bytes, value_at = ("Q", "Q", 20, 12) if big else ("I", "H", 12, 8)
    try:
        (place,) = struct.unpack_from(order + word, content, 8 if big else 4)
        while place:
            (count,) = struct.unpack_from(order + counter, content, place)
            first = place + struct.calcsize(order + counter)
            entries = [first + number * entry_bytes for number in range(min(count, MAX_TAGS))]
            yield {
                struct.unpack_from(order + "H", content, entry)[0]: _value(content, entry, order, value_at)
                for entry in entries
            }
            (place,) = struct.unpack_from(order + word, content, first + count * entry_bytes)
    except struct.error:
        return  # GDAL tells what is wrong


def _value(content: bytes, entry: int, order: str, value_at: int) -> int:
    (kind,) = struct.unpack_from(order + "H", content, entry + 2)
    found: int = struct.unpack_from(order + ("I" if kind == LONG else "H"), content, entry + value_at)[0]
    return found


def _first_directory(path: Path, content: bytes) -> dict[int, int]:
    """Tags of the only picture; smaller copies and masks of it, which may follow, do not count."""
    directories = list(islice(_directories(content), MAX_DIRECTORIES))
    pages = [tags for tags in directories[1:] if not tags.get(SUBFILE_TAG, 0) & REDUCED_OR_MASK]
    if pages or len(directories) == MAX_DIRECTORIES:
        fault = f"image {path}: it has several pages ({len(pages) + 1} or more)."
        raise RefusedError("image-not-2d", fault, "Give one picture.")
    return directories[0] if directories else {}


def _upright(values: NDArray[Any], orientation: int) -> NDArray[Any]:
    """The picture with its first line on top and its first sample on the left."""
    if 5 <= orientation <= 8:
        values = values.T
    upside_down, mirrored = orientation in (3, 4, 7, 8), orientation in (2, 3, 6, 7)
    values = values[::-1] if upside_down else values
    return np.ascontiguousarray(values[:, ::-1] if mirrored else values)
