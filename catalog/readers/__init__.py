"""Readers: one per file format behind one Protocol, chosen by the file's first bytes.

`read_frame` is all that the rest of the program needs. Plugins' readers are asked before our own, so that one can know
more of some FITS files than ours does.
"""

from functools import cache
from pathlib import Path

from catalog.errors import RefusedError
from catalog.flips import Flip
from catalog.observation import Frame
from catalog.plugins import READERS as GROUP
from catalog.plugins import contributed
from catalog.readers.finishing import frame_of_reading
from catalog.readers.fits import FitsReader
from catalog.readers.imq import ImqReader
from catalog.readers.picture import PictureReader
from catalog.readers.plugged import PluggedReader, readers_of
from catalog.readers.reading import HEAD_BYTES, MAX_FILE_BYTES, Reader
from catalog.readers.tiff import TiffReader
from catalog.readers.vicar import VicarReader
from catalog.regular_file import TooLargeError, open_regular

READERS: tuple[Reader, ...] = (VicarReader(), ImqReader(), FitsReader(), PictureReader(), TiffReader())

__all__ = ["READERS", "all_readers", "image_is_folder", "plugin_reader_of", "read_frame"]


@cache
def plugin_readers() -> dict[str, PluggedReader]:
    """Usable readers of plugins by name."""
    return contributed(GROUP, readers_of, ())


def all_readers() -> tuple[Reader, ...]:
    """Every reader in the order of asking."""
    return (*plugin_readers().values(), *READERS)


def plugin_reader_of(path: Path) -> str | None:
    """Name of the plugin's reader that reads this file; None where one of our own does, or none."""
    if not plugin_readers():
        return None
    head = _head(path)
    return next((name for name, reader in plugin_readers().items() if reader.recognises(head, path)), None)


def read_frame(path: Path, camera: str | None = None, target: str | None = None, flip: Flip | None = None) -> Frame:
    """The image of a file with all that is known about it.

    camera, target: name or TOML file; both override what the label says. Vectors and geometry that the label gives for
    another target than `target` are dropped. flip: applied to the picture, and all that belongs to its pixels, before
    anything else.

    Raises RefusedError, naming the file, the fault and the remedy, for whatever cannot be read as one grey image, and
    for an image whose size is not its camera's.
    """
    path = Path(path)
    head = _head(path)
    reader = next((reader for reader in all_readers() if reader.recognises(head, path)), None)
    if reader is None:
        raise RefusedError(
            "image-format-unknown",
            f"image {path}: {_description(head)}.",
            "VICAR (Voyager, Galileo, Cassini), compressed Voyager .imq, FITS, PNG and TIFF are read; unpack archives.",
        )
    try:
        reading = reader.read(path)
    except (OSError, MemoryError) as error:
        raise RefusedError("image-unreadable", f"image {path} cannot be read ({error}).") from error
    return frame_of_reading(path, reading if flip is None else reading.flipped(flip), camera, target)


def _head(path: Path) -> bytes:
    remedy = "Give the path of an image file."
    try:
        if path.is_dir():
            raise image_is_folder(path)
        with open_regular(path, MAX_FILE_BYTES) as file:
            return file.read(HEAD_BYTES)
    except FileNotFoundError as error:
        raise RefusedError("image-missing", f"image {path} does not exist.", remedy) from error
    except TooLargeError as error:
        raise RefusedError("image-too-large", f"image {path}: {error.strerror}.", "Give a single frame.") from error
    except OSError as error:
        raise RefusedError("image-unreadable", f"image {path} cannot be opened ({error}).", remedy) from error


def image_is_folder(path: Path) -> RefusedError:
    """The refusal of a folder in place of an image."""
    remedy = f"Give the files in it, for example {path}/*.IMG."
    return RefusedError("image-is-folder", f"image {path} is a folder.", remedy)


def _description(head: bytes) -> str:
    if not head:
        return "the file is empty"
    if head.startswith((b"\x1f\x8b", b"PK\3\4", b"BZh", b"\xfd7zXZ")):
        return "it is a compressed archive"
    if _is_text(head):
        return "it is a text or a detached label, not an image"
    return "its first bytes are those of no known image format"


def _is_text(head: bytes) -> bool:
    return head.isascii() and all(byte >= 32 or byte in b"\t\n\r\f" for byte in head)
