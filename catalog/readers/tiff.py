"""Reader of TIFF pictures of every depth and layout, by GDAL: Pillow wraps 32-bit numbers and inverts.

The numbers are the file's: 1 to 64 bits, signed, unsigned or floating, whatever byte order, compression, strips or
tiles. Red, green and blue become grey, with a remark; of other bands one has to be named. Where the file says that zero
is white, brightness is the largest number minus the file's. Pixels of strips that were never written, and of GDAL's no-
data value, are MISSING.
"""

import struct
import warnings
from collections.abc import Iterator
from contextlib import ExitStack
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.errors import RefusedError
from catalog.observation import Quality
from catalog.readers.bands import chosen_plane
from catalog.readers.grey import grey_of_colours
from catalog.readers.reading import MAX_PIXELS, Reading, checked_shape, unreadable
from catalog.reasons import Reason
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
MAX_BANDS = 1000


class TiffReader:
    """TIFF and BigTIFF."""

    def recognises(self, head: bytes, path: Path) -> bool:  # noqa: ARG002
        """The byte order, and 42 or 43."""
        return head.startswith(MAGIC)

    def read(self, path: Path, plane: str | None = None) -> Reading:
        """Pixels of one grey picture, of several bands or pages the one that is named. Raises RefusedError where it is
        not, and for damage."""
        from rasterio._err import CPLE_BaseError  # what properties of a damaged file raise
        from rasterio.errors import RasterioError
        from rasterio.io import MemoryFile

        content = read_regular(path)  # from memory: GDAL neither sees the path's syntax nor the files beside it
        pages = _pages(path, content)
        try:
            with warnings.catch_warnings(), ExitStack() as opened:
                warnings.simplefilter("ignore")
                file = opened.enter_context(MemoryFile(content))
                remarks: tuple[str, ...] = ()
                if len(pages) > 1:
                    tags, picture, band = _page(path, file.name, pages, plane, opened)
                    pixels, quality = _grey_pixels(path, picture, tags.get(PHOTOMETRIC_TAG, 1), band)
                else:
                    tags = pages[0][1] if pages else {}
                    picture = opened.enter_context(file.open(driver="GTiff"))
                    pixels, quality, remarks = _pixels(path, picture, tags.get(PHOTOMETRIC_TAG, 1), plane)
        except (RasterioError, CPLE_BaseError, OSError, ValueError, TypeError, LookupError, ArithmeticError) as error:
            raise unreadable(path, f"no sound TIFF ({' '.join(str(error).split())})") from error
        turn = tags.get(ORIENTATION_TAG, 1)
        return Reading(
            format="picture",
            image=upright(pixels, turn),
            quality=upright(quality, turn),
            raw_dn=pixels.dtype.kind in "iu",
            remarks=remarks,
        )


def _pixels(
    path: Path, picture: Any, photometric: int, plane: str | None
) -> tuple[NDArray[Any], NDArray[np.uint16], tuple[str, ...]]:
    """One picture, its flags, and remarks."""
    checked_shape(path, picture.height, picture.width)
    if picture.count > MAX_BANDS:
        raise unreadable(path, f"it has {picture.count} bands")
    roles = [role.name for role in picture.colorinterp]
    bands = [number for number, role in enumerate(roles, 1) if role != "alpha"]
    names = [roles[band - 1] if roles[band - 1] not in ("undefined", "gray") else "" for band in bands]
    names = [picture.descriptions[band - 1] or name for band, name in zip(bands, names, strict=True)]
    is_colour = [roles[band - 1] for band in bands] == ["red", "green", "blue"]
    kinds = {np.dtype(picture.dtypes[band - 1]).kind for band in bands}
    if (
        is_colour
        and plane is None
        and kinds <= set("iuf")
        and picture.count * picture.width * picture.height <= MAX_PIXELS
    ):
        parts = [_grey_pixels(path, picture, photometric, band) for band in bands]
        grey, remarks = grey_of_colours(path, np.stack([pixels for pixels, _ in parts], axis=-1), None, names)
        return grey, np.bitwise_or.reduce([quality for _, quality in parts]), remarks
    band = bands[chosen_plane(path, names, plane)] if bands else 1
    return *_grey_pixels(path, picture, photometric, band), ()


def _grey_pixels(path: Path, picture: Any, photometric: int, band: int) -> tuple[NDArray[Any], NDArray[np.uint16]]:
    kind = str(picture.dtypes[band - 1])
    tags = picture.tags(ns="IMAGE_STRUCTURE") | picture.tags(band, ns="IMAGE_STRUCTURE")
    white_is_zero = photometric == WHITE_IS_ZERO
    if photometric == PALETTE:
        fault = f"image {path}: a TIFF of colours of a palette mixes exposures."
        raise RefusedError(Reason.IMAGE_COLOUR, fault, REMEDY_GREY)
    if np.dtype(kind).kind not in "iuf" or (white_is_zero and np.dtype(kind).kind != "u"):
        zero = " whose zero is white" if white_is_zero else ""
        raise RefusedError(
            Reason.IMAGE_COLOUR, f"image {path}: TIFF numbers of type {kind}{zero} are not read.", REMEDY_GREY
        )
    pixels = picture.read(band)
    missing = _never_written(path, picture, band)
    if picture.nodata is not None:
        missing |= pixels == picture.nodata
    if white_is_zero:
        bits = int(tags.get("NBITS", np.dtype(kind).itemsize * 8))
        pixels = np.asarray((1 << bits) - 1 - pixels.astype(np.uint64)).astype(kind)
    return pixels, np.where(missing, Quality.MISSING, 0).astype(np.uint16)


def _never_written(path: Path, picture: Any, band: int) -> NDArray[np.bool_]:
    """Mask (ny, nx) of strips and tiles that the file has no bytes for, which GDAL reads as zeros."""
    missing = np.zeros((picture.height, picture.width), bool)
    high, wide = picture.block_shapes[0]
    rows, columns = -(-picture.height // high), -(-picture.width // wide)
    if rows * columns > MAX_BLOCKS:
        raise unreadable(path, f"it has {rows * columns} strips or tiles")
    for row in range(rows):
        for column in range(columns):
            if not int(picture.get_tag_item(f"BLOCK_OFFSET_{column}_{row}", "TIFF", bidx=band) or 0):
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
    except (struct.error, OverflowError):  # beyond the file, or beyond what an offset can be
        return  # GDAL tells what is wrong


def _value(content: bytes, entry: int, order: str, value_at: int) -> int:
    (kind,) = struct.unpack_from(order + "H", content, entry + 2)
    found: int = struct.unpack_from(order + ("I" if kind == LONG else "H"), content, entry + value_at)[0]
    return found


def _pages(path: Path, content: bytes) -> list[tuple[int, dict[int, int]]]:
    """Number in the file (from 1) and tags of every picture; smaller copies and masks of it do not count."""
    directories = list(islice(_directories(content), MAX_DIRECTORIES))
    if len(directories) == MAX_DIRECTORIES:
        fault = f"image {path}: it has {MAX_DIRECTORIES} pages or more."
        raise RefusedError(Reason.IMAGE_NOT_2D, fault, "Give one picture.")
    return [
        (number, tags)
        for number, tags in enumerate(directories, 1)
        if number == 1 or not tags.get(SUBFILE_TAG, 0) & REDUCED_OR_MASK
    ]


def _page(
    path: Path, name: str, pages: list[tuple[int, dict[int, int]]], plane: str | None, opened: ExitStack
) -> tuple[dict[int, int], Any, int]:
    """Of several pages the one that the user means: its tags, picture and band."""
    import rasterio

    found, names = [], []
    for number, tags in pages:
        picture = opened.enter_context(rasterio.open(f"GTIFF_DIR:{number}:{name}", driver="GTiff"))
        if picture.count > MAX_BANDS:
            raise unreadable(path, f"it has {picture.count} bands")
        bands = [band for band, role in enumerate(picture.colorinterp, 1) if role.name != "alpha"]
        found += [(tags, picture, band) for band in bands]
        names += [f"page {number}" + (f" band {band}" if len(bands) > 1 else "") for band in bands]
    tags, picture, band = found[chosen_plane(path, names, plane)]
    checked_shape(path, picture.height, picture.width)
    return tags, picture, band


def upright(values: NDArray[Any], orientation: int) -> NDArray[Any]:
    """The picture with its first line on top and its first sample on the left."""
    if 5 <= orientation <= 8:
        values = values.T
    upside_down, mirrored = orientation in (3, 4, 7, 8), orientation in (2, 3, 6, 7)
    values = values[::-1] if upside_down else values
    return np.ascontiguousarray(values[:, ::-1] if mirrored else values)
