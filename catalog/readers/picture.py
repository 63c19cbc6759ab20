"""Reader of grey PNG pictures (1 to 16 bit). They bring no metadata. TIFF: `catalog.readers.tiff`."""

import struct
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.errors import RefusedError
from catalog.readers.reading import MAX_PIXELS, Reading, checked_shape, unreadable
from catalog.regular_file import open_regular

PNG_MAGIC = b"\x89PNG\r\n\x1a\n"
MAX_CHUNKS, CHUNK_FRAME_BYTES = 50_000, 12
GREY_MODES = ("1", "L", "I", "I;16", "I;16L", "I;16B", "I;16N")
NAMES = {"LA": "grey with transparency", "P": "palette", "RGB": "red, green, blue", "RGBA": "colours, transparency"}
DEPTH_BYTE = 24  # of IHDR: bits per sample
DAMAGE = (OSError, ValueError, TypeError, LookupError, SyntaxError, ArithmeticError, AttributeError, EOFError)
"""What Pillow raises for damaged files, beside struct.error."""


class PictureReader:
    """PNG, by Pillow."""

    def recognises(self, head: bytes, path: Path) -> bool:  # noqa: ARG002
        """PNG begins with fixed bytes."""
        return head.startswith(PNG_MAGIC)

    def read(self, path: Path) -> Reading:
        """Pixels of a grey picture. Raises RefusedError for colour, several pages, bombs and damage."""
        from PIL import Image

        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                _check_chunks_of_png(path)
                with open_regular(path) as file, Image.open(file, formats=("PNG",)) as picture:
                    pixels = _grey_pixels(path, picture)
        except Image.DecompressionBombError as error:
            remedy = f"Frames up to {MAX_PIXELS} pixels are read; cut the picture."
            raise RefusedError("image-too-large", f"image {path}: {error}", remedy) from error
        except (*DAMAGE, struct.error) as error:
            raise unreadable(path, f"no sound picture ({error})") from error
        return Reading(format="picture", image=pixels, raw_dn=pixels.dtype.kind in "iu")


def _grey_pixels(path: Path, picture: Any) -> NDArray[Any]:
    checked_shape(path, picture.height, picture.width)
    if picture.mode not in GREY_MODES:
        raise RefusedError(
            "image-colour",
            f"image {path}: a PNG of mode {picture.mode} ({NAMES.get(picture.mode, 'colours')}) mixes exposures.",
            "Give one grey channel, 8 or 16 bit, or a TIFF.",
        )
    if _has_second_page(picture):
        raise RefusedError("image-not-2d", f"image {path}: it has several pages.", "Give one picture.")
    pixels = np.asarray(picture)
    if pixels.dtype == bool:
        return pixels.astype(np.uint8)
    with path.open("rb") as file:
        depth = file.read(DEPTH_BYTE + 1)[DEPTH_BYTE]
    return pixels // (255 // ((1 << depth) - 1)) if depth in (2, 4) else pixels  # Pillow stretches them to 255


def _has_second_page(picture: Any) -> bool:
    """Asked for alone: counting all pages would take a file's word for how many there are."""
    try:
        picture.seek(1)
    except EOFError:
        picture.seek(0)
        return False
    return True


def _check_chunks_of_png(path: Path) -> None:
    """Refuse a PNG of more pieces than any picture has, before they are looked at one by one."""
    size, place = path.stat().st_size, len(PNG_MAGIC)
    with open_regular(path) as file:
        if file.read(place) != PNG_MAGIC:
            return
        for _ in range(MAX_CHUNKS):
            file.seek(place)
            length = int.from_bytes(file.read(4), "big")
            place += length + CHUNK_FRAME_BYTES
            if place >= size:
                return
    raise unreadable(path, f"it has more than {MAX_CHUNKS} chunks")
