"""Images packed by gzip or bzip2: unpacked into a folder of their own, no further than an image has bytes."""

import bz2
import gzip
import shutil
import tempfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

from catalog.detached import PACKED_SUFFIXES, label_beside
from catalog.errors import RefusedError
from catalog.reasons import Reason
from catalog.regular_file import open_regular

GZIP, BZIP2 = b"\x1f\x8b", b"BZh"
MAX_UNPACKED_BYTES = 300_000_000
SMALL_BYTES, MAX_RATIO = 50_000_000, 200
"""No image of more than 50 MB is packed to a 200th: its noise alone takes more (zeros pack to a 1000th)."""
CHUNK_BYTES = 1 << 20
TOO_LARGE = "Unpack it, and give a single frame."


def is_packed(head: bytes) -> bool:
    """Whether a file begins as gzip's or bzip2's do."""
    return head.startswith((GZIP, BZIP2))


def head_of(path: Path, count: int) -> bytes:
    """The first bytes of a file, of a packed one those of what is in it; empty where that is damaged. Raises OSError as
    `open_regular` does."""
    with open_regular(path) as file:
        head = file.read(count)
        if not is_packed(head):
            return head
        file.seek(0)
        opened: Any = gzip.open if head.startswith(GZIP) else bz2.open
        try:
            with opened(file) as inner:
                return bytes(inner.read(count))
        except (OSError, EOFError, ValueError, zlib.error):
            return b""


@contextmanager
def readable(path: Path) -> Iterator[Path]:
    """The file itself or, where it is packed, the unpacked image while the `with` block lasts; as `unpacked`."""
    try:
        with open_regular(path) as file:
            packed = is_packed(file.read(len(BZIP2)))
    except OSError:
        packed = False  # who reads it says what is wrong
    if not packed:
        yield path
        return
    with unpacked(path) as image:
        yield image


@contextmanager
def unpacked(path: Path) -> Iterator[Path]:
    """The unpacked image, with its detached label beside it, while the `with` block lasts.

    Raises RefusedError, also from inside the block, with the packed file's name in it: for damage, and for what has
    more bytes than an image."""
    inner = path.stem if path.suffix.lower() in PACKED_SUFFIXES else path.name
    with tempfile.TemporaryDirectory(prefix="planetpose-") as folder:
        image = Path(folder) / (inner or "image")
        with open_regular(path) as packed, image.open("wb") as plain:
            _unpack(path, packed, plain)
        label = label_beside(path)
        if label is not None and label.name != image.name:
            shutil.copyfile(label, Path(folder) / label.name)
        try:
            yield image
        except RefusedError as refusal:
            fault, remedy = (text.replace(str(image), str(path)) for text in (refusal.fault, refusal.remedy))
            raise refusal.saying(fault, remedy) from refusal


def _unpack(path: Path, packed: BinaryIO, plain: BinaryIO) -> None:
    """Every member of the file, until something else follows."""
    most = min(MAX_UNPACKED_BYTES, max(SMALL_BYTES, MAX_RATIO * path.stat().st_size))
    content, written = packed.read(CHUNK_BYTES), 0
    while is_packed(content):
        member: Any = zlib.decompressobj(31) if content.startswith(GZIP) else bz2.BZ2Decompressor()
        try:
            while not member.eof:
                part = member.decompress(content, CHUNK_BYTES)
                written += len(part)
                if written > most:
                    fault = f"image {path}: unpacked it has more than {most} bytes."
                    raise RefusedError(Reason.IMAGE_TOO_LARGE, fault, TOO_LARGE)
                plain.write(part)
                content = _rest(member)
                if not member.eof and not content and not part:
                    content = packed.read(CHUNK_BYTES)
                    if not content:
                        raise _damaged(path, "truncated: its packed content has no end")
        except (zlib.error, OSError, EOFError, ValueError) as error:
            raise _damaged(path, f"its packed content is damaged ({error})") from error
        content = member.unused_data
        if len(content) < len(BZIP2):  # the next member's first bytes may be in the next chunk
            content += packed.read(CHUNK_BYTES)


def _damaged(path: Path, fault: str) -> RefusedError:
    remedy = "Fetch the file again from its archive."
    return RefusedError(Reason.IMAGE_UNREADABLE, f"image {path}: {fault}.", remedy)


def _rest(member: Any) -> bytes:
    """What a member has been given and has not looked at yet: zlib hands it back, bz2 keeps it."""
    return bytes(getattr(member, "unconsumed_tail", b""))
