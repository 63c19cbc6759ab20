"""Reader of grey PNG and TIFF pictures (8 and 16 bit, 32-bit whole numbers, floats). They bring no metadata."""

import struct
from pathlib import Path

import numpy as np

from catalog.errors import RefusedError
from catalog.readers.reading import Reading, checked_shape, unreadable

MAGIC = (b"\x89PNG\r\n\x1a\n", b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
GREY_MODES = ("1", "L", "I", "F", "I;16", "I;16L", "I;16B", "I;16N")


class PictureReader:
    """PNG and TIFF, by Pillow."""

    def recognises(self, head: bytes, path: Path) -> bool:  # noqa: ARG002
        """PNG and TIFF begin with fixed bytes."""
        return head.startswith(MAGIC)

    def read(self, path: Path) -> Reading:
        """Pixels of a grey picture. Raises RefusedError for colour, several pages, bombs and damage."""
        from PIL import Image

        try:
            with Image.open(path, formats=("PNG", "TIFF")) as picture:
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
        except (OSError, ValueError, TypeError, KeyError, IndexError, SyntaxError, OverflowError) as error:
            raise unreadable(path, f"no sound picture ({error})") from error
        except (EOFError, ZeroDivisionError, AttributeError, struct.error, Image.DecompressionBombError) as error:
            raise unreadable(path, f"no sound picture ({error})") from error
        if pixels.dtype == bool:
            pixels = pixels.astype(np.uint8)
        return Reading(format="picture", image=pixels, raw_dn=pixels.dtype.kind in "iu")
