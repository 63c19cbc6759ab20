"""Small files that claim, or unfold to, enormous ones: refused at once, and in little memory."""

import bz2
import gzip
import io
import struct
import time
import tracemalloc
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from astropy.io import fits
from PIL import Image
from small_vicar import VICAR_LABEL

from catalog.errors import RefusedError
from catalog.readers import read_frame
from catalog.readers.pds3_label import parse_label

# A hang, not a speed: unbounded, these take minutes or for ever; a busy machine needs several times the usual second.
LONGEST_S = 30.0  # of this process's own time, whatever else the machine does
MOST_BYTES = 150_000_000
PNG = b"\x89PNG\r\n\x1a\n"


def card(key: str, value: object) -> bytes:
    return f"{key:8s}= {value!s:>20}".ljust(80).encode()


def header(*cards: bytes) -> bytes:
    return b"".join((*cards, b"END".ljust(80))).ljust(-(-80 * (len(cards) + 1) // 2880) * 2880)


def image_header(*axes: int, parameters: int = 0, first: str = "SIMPLE", value: str = "T") -> bytes:
    sizes = [card(f"NAXIS{i}", size) for i, size in enumerate(axes, 1)]
    groups = [card("PCOUNT", parameters), card("GCOUNT", 1)]
    return header(card(first, value), card("BITPIX", 8), card("NAXIS", len(axes)), *sizes, *groups)


def extension(*axes: int, parameters: int = 0) -> bytes:
    return image_header(*axes, parameters=parameters, first="XTENSION", value="'IMAGE   '")


def chunk(kind: bytes, body: bytes) -> bytes:
    return len(body).to_bytes(4, "big") + kind + body + zlib.crc32(kind + body).to_bytes(4, "big")


def png(*chunks: bytes, width: int = 40, height: int = 30) -> bytes:
    start = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0))
    return PNG + start + b"".join(chunks) + chunk(b"IDAT", zlib.compress(bytes(41 * 30))) + chunk(b"IEND", b"")


def tiff(changes: dict[int, int], more: dict[int, int] | None = None, pages: int = 1) -> bytes:
    tags = {256: 40, 257: 30, 258: 8, 259: 1, 262: 1, 273: 8, 277: 1, 278: 30, 279: 1200} | changes | (more or {})
    length = 2 + 12 * len(tags) + 4
    entries = b"".join(struct.pack("<HHII", tag, 4, 1, value) for tag, value in sorted(tags.items()) if value >= 0)
    directories = [
        struct.pack("<H", entries.__len__() // 12)
        + entries
        + struct.pack("<I", 8 + (i + 1) * length if i < pages - 1 else 0)
        for i in range(pages)
    ]
    return b"II*\0" + struct.pack("<I", 8) + b"".join(directories) + bytes(2000)


def compressed_fits() -> bytes:
    stream = io.BytesIO()
    pixels = np.arange(10_000, dtype=np.int16).reshape(100, 100)
    fits.HDUList([fits.PrimaryHDU(), fits.CompImageHDU(pixels)]).writeto(stream)
    return stream.getvalue()


def vicar(more: bytes) -> bytes:
    label = VICAR_LABEL.replace(b"LBLSIZE=800 ", b"LBLSIZE=%d " % (len(VICAR_LABEL) + len(more) + 100)) + b"  " + more
    size = len(VICAR_LABEL) + len(more) + 100
    return label[:size].ljust(size, b"\0") + bytes(60 * 31)


def imq(*records: bytes) -> bytes:
    first = b"CCSD3ZF0000100000001NJPL3IF0PDS200000001 = SFDU_LABEL"
    return b"".join(struct.pack("<H", len(r)) + r + bytes(len(r) % 2) for r in (first, *records))


def npy(kind: str, shape: str) -> bytes:
    text = f"{{'descr': {kind}, 'fortran_order': False, 'shape': {shape}, }}".encode()
    return b"\x93NUMPY\1\0" + len(text).to_bytes(2, "little") + text + bytes(5000)


def cube(samples: int = 40, lines: int = 30, bands: int = 1, tile: int = 0, start: int = 2001) -> bytes:
    tiles = f"Format = Tile TileSamples = {tile} TileLines = {tile}" if tile else "Format = BandSequential"
    label = f"""Object = IsisCube
      Object = Core
        StartByte = {start}
        {tiles.replace(" Tile", chr(10) + "Tile")}
        Group = Dimensions
          Samples = {samples}
          Lines = {lines}
          Bands = {bands}
        End_Group
        Group = Pixels
          Type = UnsignedByte
        End_Group
      End_Object
    End_Object
    End"""
    return label.encode().ljust(2000, b"\0") + bytes(1200)


def array_of(name: str, side: int) -> bytes:
    axes = "".join(
        f"<Axis_Array><axis_name>{axis}</axis_name><elements>{side}</elements><sequence_number>{number}</sequence_number>"
        "</Axis_Array>"
        for number, axis in enumerate(("Line", "Sample"), 1)
    )
    kind = "<Element_Array><data_type>UnsignedByte</data_type></Element_Array>"
    array = f"<Array_2D_Image><offset>0</offset><axes>2</axes>{kind}{axes}</Array_2D_Image>"
    return (
        f"<File_Area_Observational><File><file_name>{name}</file_name></File>{array}</File_Area_Observational>".encode()
    )


def xml(before: bytes, inside: bytes = b"") -> bytes:
    start = b"<?xml version='1.0'?>" + before
    return (
        start
        + b"<Product_Observational xmlns='http://pds.nasa.gov/pds4/pds/v1'>"
        + inside
        + b"</Product_Observational>"
    )


BOMBS: dict[str, tuple[Callable[[], bytes], str]] = {
    "gzipped.fits": (lambda: gzip.compress(image_header(7500, 7500) + bytes(60_000_000)), "image-too-large"),
    "bzipped.fits": (lambda: bz2.compress(image_header(7500, 7500) + bytes(60_000_000)), "image-too-large"),
    "twice.fits.gz": (lambda: gzip.compress(gzip.compress(bytes(1000))), "image-format-unknown"),
    "shape.npy": (lambda: npy("'<f8'", "(1000000000, 1000000000)"), "image-too-large"),
    "planes.npy": (lambda: npy("'<f8'", "(1000000000, 9, 9)"), "image-unreadable"),
    "header.npy": (lambda: b"\x93NUMPY\2\0\xff\xff\xff\xff" + b"(" * 50_000, "image-unreadable"),
    "nested.npy": (lambda: npy("'<f8'", "(" * 4000), "image-unreadable"),
    "objects.npy": (lambda: npy("'O'", "(3, 4)"), "image-unreadable"),
    "side.cub": (lambda: cube(samples=10**9, lines=10**9), "image-too-large"),
    "bands.cub": (lambda: cube(bands=10**9), "image-unreadable"),
    "tiles.cub": (lambda: cube(tile=10**9), "image-unreadable"),
    "offset.cub": (lambda: cube(start=10**15), "image-unreadable"),
    "entities.xml": (lambda: xml(b"<!DOCTYPE a [<!ENTITY b 'cc'>]>"), "image-unreadable"),
    "elements.xml": (lambda: xml(b"", b"<a>" * 30_000 + b"</a>" * 30_000), "image-unreadable"),
    "size.xml": (lambda: xml(b"", array_of("bomb.img", 10**9)), "image-missing|image-too-large"),
    "axes.fits": (lambda: image_header(*[2**31 - 1] * 50), "image-unreadable|image-not-2d"),
    "wide.fits": (lambda: image_header(2**31 - 1, 2**31 - 1), "image-too-large|image-unreadable"),
    "parameters.fits": (lambda: image_header() + extension(30, 40, parameters=10**15), "image-unreadable"),
    "extensions.fits": (lambda: image_header() + extension() * 20_000, "image-unreadable"),
    "tile.fits": (
        lambda: compressed_fits().replace(card("ZNAXIS1", 100)[:30], card("ZNAXIS1", 10**9)[:30]),
        "image-too-large",
    ),
    "text.png": (lambda: png(chunk(b"zTXt", b"a\0\0" + zlib.compress(bytes(70_000_000)))), "image-unreadable"),
    "profile.png": (lambda: png(chunk(b"iCCP", b"a\0\0" + zlib.compress(bytes(70_000_000)))), "image-unreadable"),
    "chunks.png": (lambda: png(chunk(b"tEXt", b"a\0b") * 60_000), "image-unreadable"),
    "side.png": (lambda: png(width=2**31 - 1, height=2**31 - 1), "image-too-large|image-unreadable"),
    "tiles.tif": (
        lambda: tiff({273: -1, 278: -1, 279: -1}, {322: 2**31 - 16, 323: 2**31 - 16, 324: 8, 325: 99}),
        "image-unreadable",
    ),
    "pages.tif": (lambda: tiff({}, pages=50_000), "image-not-2d"),
    "side.tif": (lambda: tiff({256: 2**31, 257: 2**31}), "image-too-large|image-unreadable"),
    "keywords.img": (lambda: vicar(b"".join(b"K%d=%d " % (i, i) for i in range(10_000))), "image-unreadable"),
    "items.img": (lambda: vicar(b"X=(" + b"1," * 50_000 + b"1)"), "image-unreadable"),
    "nested.img": (lambda: vicar(b"X=" + b"(" * 50_000), "image-unreadable"),
    "label.img": (lambda: vicar(b"X='" + b"a" * 900_000 + b"'"), "image-unreadable"),
    "records.imq": (lambda: imq() + bytes(9_000_000), "image-unreadable"),
    "label.imq": (lambda: imq(*[b"A%d = (%s1)" % (i, b"1," * 15_000) for i in range(300)], b"END"), "image-unreadable"),
    "nested.imq": (lambda: imq(b"A = " + b"(" * 20_000, b"END"), "image-unreadable"),
}  # fmt: skip


@pytest.fixture(scope="module", autouse=True)
def libraries_are_loaded(tmp_path_factory: pytest.TempPathFactory) -> None:
    """What a first file imports does not count."""
    folder = tmp_path_factory.mktemp("warm")
    Image.new("L", (40, 30)).save(folder / "a.png")
    fits.PrimaryHDU(np.zeros((30, 40), np.uint8)).writeto(folder / "a.fits")
    (folder / "a.img").write_bytes(vicar(b""))
    for name in ("a.png", "a.fits", "a.img"):
        assert read_frame(folder / name).observation.image.shape == (30, 40)


@pytest.mark.parametrize("name", list(BOMBS))
def test_a_bomb_is_refused_in_little_time_and_memory(name: str, tmp_path: Path) -> None:
    content, codes = BOMBS[name]
    (tmp_path / name).write_bytes(content())
    tracemalloc.start()
    started = time.process_time()
    try:
        with pytest.raises(RefusedError) as refusal:
            read_frame(tmp_path / name)
        seconds, (_, peak) = time.process_time() - started, tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert refusal.value.code in codes.split("|"), refusal.value.reason
    assert name in refusal.value.fault
    assert seconds < LONGEST_S
    assert peak < MOST_BYTES


def test_a_code_tree_as_deep_as_it_can_be_is_decoded_without_recursion() -> None:
    from catalog.readers.huffman import DIFFERENCES, code_tree, decode_lines

    histogram = np.zeros(DIFFERENCES, np.int64)
    a, b = 1, 1
    for i in range(80):
        histogram[i], (a, b) = a, (b, a + b)
    children, symbols = code_tree(histogram)
    assert (symbols >= 0).sum() == 80
    lines = [np.random.default_rng(i).bytes(2046) for i in range(50)]
    pixels, filled = decode_lines(lines, 800, children, symbols)
    assert pixels.shape == (50, 800)
    assert (filled <= 800).all()


@pytest.mark.parametrize(
    "text",
    [
        "A = " + "(" * 5000,
        'A = "x" /* " */\nB = ' + "(" * 5000 + '/* " */',
        "OBJECT = A\n" * 1500,
        "OBJECT = A\n  B = 1\n",
        "A = -\n" * 1000,
        "A = 1 " + "<" * 5000,
        "A = {" + "{" * 400,
        "".join(f"K{i} = {i}\n" for i in range(3000)),
        "x" * 200_000,
        "A = 1\nB = 2\nTARG",
        "A",
    ],
)
def test_labels_that_would_busy_or_break_the_parser_are_no_labels(text: str) -> None:
    started = time.process_time()
    with pytest.raises(ValueError, match="no sound label"):
        parse_label(text)
    assert time.process_time() - started < LONGEST_S
