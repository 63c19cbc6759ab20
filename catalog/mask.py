"""A user's mask: pixels of a raw image that no step may use."""

import dataclasses
import math
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from catalog.errors import RefusedError
from catalog.observation import Observation, Quality
from catalog.reasons import Reason
from catalog.regular_file import open_regular

MAX_MASK_PIXELS = 400_000_000
MAX_MASK_BYTES = 9 * MAX_MASK_PIXELS  # doubles, and what a file says of them
KINDS = "Give a PNG, TIFF, FITS or NPY file of the image's size, non-zero where a pixel must not be used."
DAMAGE = (
    OSError,
    ValueError,
    TypeError,
    LookupError,
    SyntaxError,
    ArithmeticError,
    AttributeError,
    EOFError,
    MemoryError,
)


def read_mask(path: Path) -> NDArray[np.bool_]:
    """Mask (ny, nx), true where a pixel must not be used: a PNG or TIFF (of colours: any but 0, transparency aside),
    the first image of a FITS file, or an NPY file. What is not a number counts as true.

    Raises RefusedError, naming the file, the fault and the remedy, when it cannot be read as one picture.
    """
    path = Path(path)
    try:
        with open_regular(path, MAX_MASK_BYTES) as file:
            values = _values(file)
    except DAMAGE as error:
        raise RefusedError(Reason.MASK_UNREADABLE, f"mask {path} cannot be read ({error}).", KINDS) from error
    if values is None or values.ndim != 2 or values.dtype.kind not in "biuf":
        found = "no picture" if values is None else f"values of type {values.dtype} and shape {values.shape}"
        raise RefusedError(Reason.MASK_UNREADABLE, f"mask {path} holds {found}.", KINDS)
    return np.asarray(values != 0)


def masked(observation: Observation, mask: NDArray[np.bool_], path: Path) -> Observation:
    """Copy whose pixels under `mask` (ny, nx), the content of file `path`, are MASKED_BY_USER.

    Raises RefusedError when the mask has another size, or leaves no pixel.
    """
    if mask.shape != observation.image.shape:
        (rows, columns), (ny, nx) = mask.shape, observation.image.shape
        raise RefusedError(Reason.MASK_SIZE, f"mask {path} has {columns}x{rows} pixels, the image {nx}x{ny}.", KINDS)
    if mask.all():
        raise RefusedError(Reason.MASK_COVERS_ALL, f"mask {path} covers the whole image.", KINDS)
    quality = observation.quality | np.where(mask, np.uint16(Quality.MASKED_BY_USER), np.uint16(0))
    return dataclasses.replace(observation, quality=quality.astype(np.uint16))


def _values(file: BinaryIO) -> NDArray[Any] | None:
    head = file.read(8)
    file.seek(0)
    if head.startswith(b"\x93NUMPY"):
        return _array(file)
    if head.startswith(b"SIMPLE"):
        return _first_image(file)
    return _picture(file)


def _array(file: BinaryIO) -> NDArray[Any]:
    version = np.lib.format.read_magic(file)
    header = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, _, _ = header(file)
    _check_size(math.prod(shape))
    file.seek(0)
    return np.asarray(np.load(file, allow_pickle=False))


def _first_image(file: BinaryIO) -> NDArray[Any] | None:
    from astropy.io import fits

    with fits.open(file, memmap=True) as parts:
        for part in parts:
            if part.is_image and part.header.get("NAXIS", 0) >= 2:
                _check_size(int(np.prod(part.shape)))
                return np.array(part.data)
    return None


def _picture(file: BinaryIO) -> NDArray[Any]:
    from PIL import Image

    with Image.open(file, formats=("PNG", "TIFF")) as picture:
        _check_size(picture.width * picture.height)
        shown = picture.convert("RGB") if picture.mode == "P" else picture
        pixels = np.asarray(shown)
        if pixels.ndim < 3:
            return pixels
        colours = [number for number, band in enumerate(shown.getbands()) if band != "A"]
        return np.asarray(pixels[..., colours].any(axis=-1))


def _check_size(pixels: int) -> None:
    if pixels > MAX_MASK_PIXELS:
        raise ValueError(f"{pixels} pixels are too many")
