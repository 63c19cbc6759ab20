"""Images that spoil a batch, each by its name, what it is, what is in it, or by what happens to it meanwhile."""

import os
import socket
import struct
import zlib
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from lab.fuzz.damage import DAMAGES
from tasks.registry import INGEST, POINT, POSE, PUBLISH, UNDISTORT, VALIDATE

Generator = np.random.Generator
PNG = b"\x89PNG\r\n\x1a\n"
NESTING, HUGE_BYTES = 100_000, 10**13
STEPS = tuple(step.name for step in (INGEST, POSE, UNDISTORT, POINT, VALIDATE, PUBLISH))


@dataclass(frozen=True)
class Spoilt:
    """One image that spoils a batch. culprit: the file at fault, which a reason has to name. options: of its request,
    beside the usual ones. meanwhile: called before each of its steps with the step's kind. sound: nothing is wrong with
    it but its name, so that it has to be published."""

    image: Path
    culprit: Path
    options: dict[str, Any] = field(default_factory=dict)
    meanwhile: Callable[[str], None] = lambda _: None
    sound: bool = False


Spoil = Callable[[Path, bytes, Generator], Spoilt]


def _named(name: str, sound: bool = True) -> Spoil:
    def spoil(folder: Path, content: bytes, _: Generator) -> Spoilt:
        image = folder / os.fsdecode(os.fsencode(name))
        image.write_bytes(content)
        return Spoilt(image, image, sound=sound)

    return spoil


def _holding(make: Callable[[bytes, Generator], bytes], name: str = "spoilt.png") -> Spoil:
    def spoil(folder: Path, content: bytes, random: Generator) -> Spoilt:
        image = folder / name
        image.write_bytes(make(content, random))
        return Spoilt(image, image)

    return spoil


def _being(make: Callable[[Path], object]) -> Spoil:
    def spoil(folder: Path, _: bytes, __: Generator) -> Spoilt:
        image = folder / "spoilt.png"
        make(image)
        return Spoilt(image, image)

    return spoil


def _with_option(option: str, make: Callable[[Path], object], name: str) -> Spoil:
    def spoil(folder: Path, content: bytes, _: Generator) -> Spoilt:
        image, file = folder / "spoilt.png", folder / name
        image.write_bytes(content)
        make(file)
        text = option == "camera"
        return Spoilt(image, file, {option: (file,) if option == "kernels" else str(file) if text else file})

    return spoil


def _meanwhile(happen: Callable[[Path, bytes], object]) -> Spoil:
    def spoil(folder: Path, content: bytes, random: Generator) -> Spoilt:
        image, when = folder / "spoilt.png", STEPS[int(random.integers(len(STEPS)))]
        image.write_bytes(content + random.bytes(8))  # whose steps nobody has done yet
        return Spoilt(image, image, meanwhile=lambda step: _once(image, content, happen) if step == when else None)

    return spoil


def _once(image: Path, content: bytes, happen: Callable[[Path, bytes], object]) -> None:
    mark = image.with_name("happened")
    if not mark.exists():
        mark.touch()
        happen(image, content)


def _grows(image: Path, content: bytes) -> None:
    with image.open("ab") as file:
        file.write(content)


def _exchanged_for(make: Callable[[Path], object]) -> Callable[[Path, bytes], object]:
    def happen(image: Path, _: bytes) -> None:
        other = image.with_name("other")
        make(other)
        other.replace(image)

    return happen


def _other_image(path: Path) -> None:
    from PIL import Image

    pixels = np.random.default_rng(7).integers(0, 60_000, (64, 72)).astype(np.uint16)
    Image.fromarray(pixels).save(path, format="PNG")


def _socket(path: Path) -> None:
    here = os.getcwd()
    os.chdir(path.parent)  # the whole path may be too long for a socket
    try:
        with socket.socket(socket.AF_UNIX) as bound:
            bound.bind(path.name)
    finally:
        os.chdir(here)


def _without_rights(path: Path) -> None:
    path.write_bytes(b"nobody")
    path.chmod(0)


def _sparse(path: Path) -> None:
    with path.open("wb") as file:
        file.truncate(HUGE_BYTES)


def _bomb(side: int) -> Callable[[bytes, Generator], bytes]:
    def make(_: bytes, __: Generator) -> bytes:
        head = struct.pack(">IIBBBBB", side, side, 16, 0, 0, 0, 0)
        return PNG + _chunk(b"IHDR", head) + _chunk(b"IDAT", zlib.compress(bytes(10_000_000))) + _chunk(b"IEND", b"")

    return make


def _chunk(kind: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))


def _many_chunks(content: bytes, _: Generator) -> bytes:
    return content[:33] + _chunk(b"tEXt", b"a\0b") * 200_000 + content[33:]


def _endless_fits(_: bytes, __: Generator) -> bytes:
    return f"{'SIMPLE  =                    T':80s}".encode() + f"{'COMMENT   more':80s}".encode() * 300_000


def _vicar(_: bytes, __: Generator) -> bytes:
    return b"LBLSIZE=999999999           FORMAT='BYTE' NL=99999999 NS=99999999 RECSIZE=4 "


def _damaged(content: bytes, random: Generator) -> bytes:
    names = list(DAMAGES)
    return DAMAGES[names[int(random.integers(len(names)))]](content, random)


def _nested_json(path: Path) -> None:
    path.write_text('{"et": ' + "[" * NESTING + "]" * NESTING + "}")


def _nested_toml(path: Path) -> None:
    path.write_text('name = "small"\nx = ' + "[" * NESTING + "]" * NESTING + "\n")


def _nested_label(folder: Path, content: bytes, _: Generator) -> Spoilt:
    image = folder / "spoilt.png"
    image.write_bytes(content)
    image.with_suffix(".LBL").write_text("PDS_VERSION_ID = PDS3\nA = " + "(" * NESTING + ")" * NESTING + "\nEND\n")
    return Spoilt(image, image.with_suffix(".LBL"))


def _zero(path: Path) -> None:
    path.symlink_to("/dev/zero")


SPOILS: dict[str, Spoil] = {
    "name: no UTF-8": _named("spoilt-\udcff.png", sound=False),
    "name: newline and controls": _named("a\nb\x1b[31m\x7f.png"),
    "name: emoji and direction mark": _named("\U0001f6f0\u202egnp.png"),
    "name: combining": _named("a\u0308o\u0308.png"),
    "name: 255 bytes": _named("x" * 251 + ".png"),
    "name: dash": _named("--store.png"),
    "name: dots and spaces": _named("spoilt. . .png"),
    "name: index.parquet": _named("index.parquet.png"),
    "name: reprocess.csv": _named("reprocess.csv.png"),
    "name: cube.zarr": _named("Cube.Zarr.png"),
    "name: another case": _named("SMALL-00000.png"),
    "is a pipe": _being(os.mkfifo),
    "is a socket": _being(_socket),
    "is a link to a device": _being(_zero),
    "is a folder": _being(Path.mkdir),
    "is a link to nothing": _being(lambda path: path.symlink_to("nothing")),
    "is a link to itself": _being(lambda path: path.symlink_to(path)),
    "is not there": _being(lambda _: None),
    "has no rights": _being(_without_rights),
    "is empty": _holding(lambda *_: b""),
    "is sparse and huge": _being(_sparse),
    "bomb": _holding(_bomb(19_000)),
    "larger bomb": _holding(_bomb(2_000_000_000)),
    "header: 200 000 chunks": _holding(_many_chunks),
    "header: endless FITS": _holding(_endless_fits, "spoilt.fits"),
    "header: VICAR of 1 GB": _holding(_vicar, "spoilt.img"),
    "damaged": _holding(_damaged),
    "nested label": _nested_label,
    "nested pose file": _with_option("pose_file", _nested_json, "nested.json"),
    "nested camera file": _with_option("camera", _nested_toml, "nested.toml"),
    "pose file is a pipe": _with_option("pose_file", os.mkfifo, "pipe.json"),
    "camera file is a pipe": _with_option("camera", os.mkfifo, "pipe.toml"),
    "mask is a device": _with_option("mask", _zero, "zero.png"),
    "map is a pipe": _with_option("basemap", os.mkfifo, "pipe.png"),
    "shape is a pipe": _with_option("shape", os.mkfifo, "pipe.obj"),
    "kernel is a pipe": _with_option("kernels", os.mkfifo, "pipe.bsp"),
    "vanishes": _meanwhile(lambda image, _: image.unlink()),
    "grows": _meanwhile(_grows),
    "is exchanged for another": _meanwhile(_exchanged_for(_other_image)),
    "is exchanged for a pipe": _meanwhile(_exchanged_for(os.mkfifo)),
    "is cut short": _meanwhile(lambda image, content: image.write_bytes(content[: len(content) // 2])),
}
