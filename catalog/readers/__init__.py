"""Readers: one per file format behind one Protocol, chosen by the file's first bytes.

`read_frame` is all that the rest of the program needs. Plugins' readers are tried before our own, so that one can know
more of some FITS files than ours does.
"""

from functools import cache
from pathlib import Path

from catalog.detached import packed_beside
from catalog.errors import RefusedError
from catalog.flips import Flip
from catalog.image_mode import ImageMode
from catalog.observation import Frame
from catalog.packed import is_packed, unpacked
from catalog.plugins import READERS as GROUP
from catalog.plugins import contributed
from catalog.readers.beside import completed, pixel_file
from catalog.readers.finishing import frame_of_reading
from catalog.readers.fits import FitsReader
from catalog.readers.imq import ImqReader
from catalog.readers.isis import IsisReader
from catalog.readers.npy import NpyReader
from catalog.readers.pds3_image import Pds3Reader
from catalog.readers.pds4 import Pds4Reader
from catalog.readers.picture import PictureReader
from catalog.readers.plugged import PluggedReader, readers_of
from catalog.readers.reading import HEAD_BYTES, MAX_FILE_BYTES, Reader, Reading
from catalog.readers.tiff import TiffReader
from catalog.readers.vicar import VicarReader
from catalog.reasons import Reason
from catalog.regular_file import TooLargeError, open_regular

READERS: tuple[Reader, ...] = (
    VicarReader(), ImqReader(), FitsReader(), PictureReader(), TiffReader(), NpyReader(), IsisReader(), Pds3Reader(),
    Pds4Reader(),
)  # fmt: skip
OF_LABELS = 3
"""The last ones also read files without a mark of their own, which a label beside them describes."""

__all__ = ["READERS", "all_readers", "image_is_folder", "plugin_reader_of", "read_frame"]


@cache
def plugin_readers() -> dict[str, PluggedReader]:
    """Usable readers of plugins by name."""
    return contributed(GROUP, readers_of, ())


def all_readers() -> tuple[Reader, ...]:
    """Every reader in the order in which they are tried."""
    return (*plugin_readers().values(), *READERS)


def plugin_reader_of(path: Path) -> str | None:
    """Name of the plugin's reader that reads this file; None where one of our own does, or none."""
    if not plugin_readers():
        return None
    head = _head(path)
    return next((name for name, reader in plugin_readers().items() if reader.recognises(head, path)), None)


def read_frame(
    path: Path,
    camera: str | None = None,
    target: str | None = None,
    flip: Flip | None = None,
    plane: str | None = None,
    mode: ImageMode | None = None,
) -> Frame:
    """The image of a file with all that is known about it.

    camera, target: name or TOML file; both override what the label says. Vectors and geometry that the label gives for
    another target than `target` are dropped. flip: applied to the picture, and all that belongs to its pixels, before
    anything else. plane: number (from 1) or name of the one to read, where the file has several. mode: summing and
    window of the image, overriding the label's; None takes the label's, or what the frame's size says.

    Raises RefusedError, naming the file, the fault and the remedy, for whatever cannot be read as one grey image, and
    for an image whose size is neither its camera's nor that of a known mode of it.
    """
    path = Path(path)
    head = _head(path)
    packed = path if is_packed(head) else packed_beside(path)
    if packed is not None:
        with unpacked(packed) as image:
            reading = _read(image, _head(image), plane)
    else:
        reading = _read(path, head, plane)
    return frame_of_reading(path, reading if flip is None else reading.flipped(flip), camera, target, mode)


def _read(path: Path, head: bytes, plane: str | None) -> Reading:
    """The file by the reader that knows it; a label by the reader of the file that it describes, if that has one."""
    given, pixels = path, pixel_file(path)
    if pixels != path and _reader_of(_head(pixels), pixels, READERS[:-OF_LABELS]) is not None:
        head, path = _head(pixels), pixels
    elif is_packed(head):
        raise RefusedError(Reason.IMAGE_FORMAT_UNKNOWN, f"image {path}: it is packed twice.", "Unpack it.")
    reader = _reader_of(head, path, all_readers())
    if reader is None:
        raise RefusedError(
            Reason.IMAGE_FORMAT_UNKNOWN,
            f"image {path}: {_description(head)}.",
            "VICAR, compressed Voyager .imq, FITS, ISIS cubes, PDS3 and PDS4 (keep label and image in one folder, "
            "under the names that the label gives), PNG, TIFF, JPEG, NPY, and any of them in .gz or .bz2, are read.",
        )
    try:
        return completed(reader.read(path, plane), path)
    except RefusedError as refusal:
        if given.name in refusal.fault or isinstance(reader, PluggedReader):
            raise
        raise refusal.saying(f"image {given}: {refusal.fault}", refusal.remedy) from refusal
    except (OSError, MemoryError) as error:
        raise RefusedError(Reason.IMAGE_UNREADABLE, f"image {given} cannot be read ({error}).") from error


def _reader_of(head: bytes, path: Path, readers: tuple[Reader, ...]) -> Reader | None:
    return next((reader for reader in readers if reader.recognises(head, path)), None)


def _head(path: Path) -> bytes:
    remedy = "Give the path of an image file."
    try:
        if path.is_dir():
            raise image_is_folder(path)
        with open_regular(path, MAX_FILE_BYTES) as file:
            return file.read(HEAD_BYTES)
    except FileNotFoundError as error:
        raise RefusedError(Reason.IMAGE_MISSING, f"image {path} does not exist.", remedy) from error
    except TooLargeError as error:
        raise RefusedError(
            Reason.IMAGE_TOO_LARGE, f"image {path}: {error.strerror}.", "Give a single frame."
        ) from error
    except OSError as error:
        raise RefusedError(Reason.IMAGE_UNREADABLE, f"image {path} cannot be opened ({error}).", remedy) from error


def image_is_folder(path: Path) -> RefusedError:
    """The refusal of a folder in place of an image."""
    remedy = f"Give the files in it, for example {path}/*.IMG."
    return RefusedError(Reason.IMAGE_IS_FOLDER, f"image {path} is a folder.", remedy)


def _description(head: bytes) -> str:
    if not head:
        return "the file is empty"
    if head.startswith((b"PK\3\4", b"\xfd7zXZ")):
        return "it is a compressed archive"
    if _is_text(head):
        return "it is a text or a detached label, not an image"
    return "its first bytes are those of no known image format"


def _is_text(head: bytes) -> bool:
    return head.isascii() and all(byte >= 32 or byte in b"\t\n\r\f" for byte in head)
