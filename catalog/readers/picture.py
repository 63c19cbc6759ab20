"""Reader of grey PNG and TIFF pictures (8 and 16 bit, 32-bit whole numbers, floats). They bring no metadata."""

import struct
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.errors import RefusedError
from catalog.readers.reading import MAX_PIXELS, Reading, checked_shape, unreadable

MAGIC = (b"\x89PNG\r\n\x1a\n", b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
GREY_MODES = ("1", "L", "I", "F", "I;16", "I;16L", "I;16B", "I;16N")
DAMAGE = (OSError, ValueError, TypeError, LookupError, SyntaxError, ArithmeticError, AttributeError, EOFError)
"""What Pillow raises for damaged files, beside struct.error."""


class PictureReader:
    """PNG and TIFF, by Pillow."""

    def recognises(self, head: bytes, path: Path) -> bool:  # noqa: ARG002
        """PNG and TIFF begin with fixed bytes."""
        return head.startswith(MAGIC)

    def read(self, path: Path) -> Reading:
        """Pixels of a grey picture. Raises RefusedError for colour, several pages, bombs and damage."""
        from PIL import Image

        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                with Image.open(path, formats=("PNG", "TIFF")) as picture:
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
            f"image {path}: a colour picture ({picture.mode}) mixes exposures.",
            "Give one grey channel, 8 or 16 bit or float.",
        )
    if getattr(picture, "n_frames", 1) != 1:
        raise RefusedError("image-not-2d", f"image {path}: it has several pages.", "Give one picture.")
    pixels = np.asarray(picture)
    return pixels.astype(np.uint8) if pixels.dtype == bool else pixels
