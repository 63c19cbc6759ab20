"""Reader of PNG (1 to 16 bit) and JPEG pictures. They bring no metadata, but that EXIF may say
where the first line is. Colours become grey, with a remark.

TIFF: `catalog.readers.tiff`.
"""

import struct
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.errors import RefusedError
from catalog.observation import Quality
from catalog.readers.bands import chosen_plane
from catalog.readers.grey import grey_of_colours
from catalog.readers.reading import MAX_PIXELS, Reading, checked_shape, unreadable
from catalog.readers.tiff import ORIENTATION_TAG, upright
from catalog.reasons import Reason
from catalog.regular_file import open_regular, read_regular

PNG_MAGIC = b"\x89PNG\r\n\x1a\n"
MAX_CHUNKS, CHUNK_FRAME_BYTES = 50_000, 12
JPEG_MAGIC = b"\xff\xd8\xff"
GREY_MODES = ("1", "L", "I", "I;16", "I;16L", "I;16B", "I;16N")
COLOUR_MODES = ("LA", "P", "RGB", "RGBA", "PA", "La")
DEPTH_BYTE = 24  # of IHDR: bits per sample
LOSSY = "a JPEG is compressed with losses of some data numbers, more beside edges: give the original where there is one"
DAMAGE = (OSError, ValueError, TypeError, LookupError, SyntaxError, ArithmeticError, AttributeError, EOFError)
"""What Pillow raises for damaged files, beside struct.error."""


class PictureReader:
    """PNG and JPEG, by Pillow; PNG of colours of 16 bit by GDAL, for Pillow has only 8 of them."""

    def recognises(self, head: bytes, path: Path) -> bool:  # noqa: ARG002
        """Both begin with fixed bytes."""
        return head.startswith((PNG_MAGIC, JPEG_MAGIC))

    def read(self, path: Path, plane: str | None = None) -> Reading:
        """Pixels of a grey picture. Raises RefusedError for several pages, bombs and damage."""
        from PIL import Image

        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                _check_chunks_of_png(path)
                with open_regular(path) as file, Image.open(file, formats=("PNG", "JPEG")) as picture:
                    is_lossy = picture.format != "PNG"
                    pixels, quality, remarks = _pixels(path, picture, plane)
                    turn = int(picture.getexif().get(ORIENTATION_TAG, 1))
        except Image.DecompressionBombError as error:
            remedy = f"Frames up to {MAX_PIXELS} pixels are read; cut the picture."
            raise RefusedError(Reason.IMAGE_TOO_LARGE, f"image {path}: {error}", remedy) from error
        except (*DAMAGE, struct.error) as error:
            raise unreadable(path, f"no sound picture ({error})") from error
        return Reading(
            format="picture",
            image=upright(pixels, turn),
            quality=None if quality is None else upright(quality, turn),
            raw_dn=pixels.dtype.kind in "iu",
            remarks=(*remarks, *([LOSSY] if is_lossy else [])),
            flags_from="its transparency",
        )


def _pixels(
    path: Path, picture: Any, plane: str | None
) -> tuple[NDArray[Any], NDArray[np.uint16] | None, tuple[str, ...]]:
    """One picture, MISSING where it is transparent, and remarks."""
    checked_shape(path, picture.height, picture.width)
    if _has_second_page(picture):
        raise RefusedError(Reason.IMAGE_NOT_2D, f"image {path}: it has several pages.", "Give one picture.")
    if picture.mode in GREY_MODES:
        if plane is not None:
            chosen_plane(path, ["grey"], plane)
        grey = _grey_pixels(path, picture)
        see_through = picture.info.get("transparency")  # of a grey PNG: one grey
        return grey, _hidden(grey != see_through) if isinstance(see_through, int) else None, ()
    if picture.mode not in COLOUR_MODES:
        fault = f"image {path}: a picture of mode {picture.mode} is neither grey nor red, green, blue."
        raise RefusedError(Reason.IMAGE_COLOUR, fault, "Give one grey channel, 8 or 16 bit, or a TIFF.")
    channels = _deep_colours(path) if _is_deep(path) else np.asarray(picture.convert("RGBA"))
    opaque = channels[..., -1] > 0 if channels.shape[2] in (2, 4) else None
    colours = channels[..., : channels.shape[2] - (opaque is not None)]
    names = ("grey",) if colours.shape[2] == 1 else ("red", "green", "blue")
    grey, remarks = grey_of_colours(path, colours, plane, names)
    return grey, None if opaque is None else _hidden(opaque), remarks


def _hidden(opaque: NDArray[np.bool_]) -> NDArray[np.uint16] | None:
    return None if opaque.all() else np.where(opaque, 0, int(Quality.MISSING)).astype(np.uint16)


def _is_deep(path: Path) -> bool:
    """Whether a PNG has 16 bits per sample."""
    with open_regular(path) as file:
        head = file.read(DEPTH_BYTE + 1)
    return head.startswith(PNG_MAGIC) and len(head) > DEPTH_BYTE and head[DEPTH_BYTE] == 16


def _deep_colours(path: Path) -> NDArray[Any]:
    """All channels (ny, nx, bands) of a PNG of 16 bit, by GDAL."""
    from rasterio._err import CPLE_BaseError
    from rasterio.errors import RasterioError
    from rasterio.io import MemoryFile

    try:
        with MemoryFile(read_regular(path)) as file, file.open(driver="PNG") as picture:
            checked_shape(path, picture.height, picture.width)
            return np.moveaxis(picture.read(), 0, -1)
    except (RasterioError, CPLE_BaseError) as error:
        raise ValueError(" ".join(str(error).split())) from error


def _grey_pixels(path: Path, picture: Any) -> NDArray[Any]:
    pixels = np.asarray(picture)
    if pixels.dtype == bool:
        return pixels.astype(np.uint8)
    with open_regular(path) as file:
        head = file.read(DEPTH_BYTE + 1)
    depth = head[DEPTH_BYTE] if head.startswith(PNG_MAGIC) else 8
    return pixels // (255 // ((1 << depth) - 1)) if depth in (2, 4) else pixels  # Pillow stretches them to 255


def _has_second_page(picture: Any) -> bool:
    """Only the second page is looked for: to count all of them the file's own number would have to be relied on."""
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
