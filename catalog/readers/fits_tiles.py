"""Tiles of compressed FITS images, looked at before astropy unpacks them (FITS standard 4.0, section 10).

It takes their sizes on trust: a tile that is unpacked to more than its pixels would exhaust memory (gzip), or overwrite
it (hcompress).
"""

import zlib
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.readers.reading import MAX_PIXELS, unreadable

DECODERS = ("astropy.io.fits.hdu.compressed._compression", "astropy.io.fits._tiled_compression._compression")
COLUMNS = ("COMPRESSED_DATA", "GZIP_COMPRESSED_DATA")
MAX_TILES = 1_000_000
MAX_ITEM_BYTES = 8
GZIP, HCOMPRESS = b"\x1f\x8b", b"\xdd\x99"


def check_tiles(path: Path, hdu: Any, axes: list[int]) -> None:
    """Refuse tiles that are larger than any picture, or would be unpacked to more than their pixels. axes: lengths of
    the image's axes, the fastest first."""
    sides = [int(side) for side in reversed(hdu.tile_shape)]
    if len(sides) != len(axes) or min(sides) < 1 or prod(sides) > MAX_PIXELS:
        raise unreadable(path, f"its tiles have the sides {sides}")
    counts = _pixels_of_tiles(path, axes, sides)
    packed = hdu.compressed_data
    if len(packed) != counts.size:
        raise unreadable(path, f"it has {len(packed)} tiles for a picture of {counts.size}")
    for column in (name for name in COLUMNS if name in packed.columns.names):
        for tile, count in zip(packed[column], counts, strict=True):
            content = np.asarray(tile).tobytes()
            if not _fits(content, int(count)):
                raise unreadable(path, f"one of its tiles holds more than its {count} pixels")


@cache
def tile_faults() -> tuple[type[Exception], ...]:
    """What astropy raises for tiles that cannot be unpacked: an exception of its own, in a module that has moved."""
    modules = (find_spec(name) and import_module(name) for name in DECODERS if find_spec(name.rpartition(".")[0]))
    return tuple(module.CfitsioException for module in modules if module)


def _pixels_of_tiles(path: Path, axes: list[int], sides: list[int]) -> NDArray[np.int64]:
    if prod(-(-length // side) for length, side in zip(axes, sides, strict=True)) > MAX_TILES:
        raise unreadable(path, "it has too many tiles")
    counts = np.ones(1, np.int64)
    for length, side in zip(axes, sides, strict=True):
        lengths = np.minimum(side, length - np.arange(0, length, side))
        counts = np.outer(lengths, counts).ravel()
    return counts


def _fits(content: bytes, pixels: int) -> bool:
    if content.startswith(GZIP):
        most = pixels * MAX_ITEM_BYTES
        return len(zlib.decompressobj(31).decompress(content, most + 1)) <= most
    if content.startswith(HCOMPRESS):
        return int.from_bytes(content[2:6], "big") * int.from_bytes(content[6:10], "big") == pixels
    return True
