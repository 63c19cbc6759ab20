"""TIFF and PNG give the file's numbers, or are refused with the name of the format."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
import rasterio.shutil
import tifffile
from numpy.typing import NDArray
from PIL import Image, ImageOps

from catalog.errors import RefusedError
from catalog.observation import Quality
from catalog.readers import read_frame

pytestmark = pytest.mark.filterwarnings("ignore::rasterio.errors.NotGeoreferencedWarning")
RNG = np.random.default_rng(9)


def full_range(kind: str) -> NDArray[Any]:
    """Numbers (37, 53) over the whole range of a type."""
    if np.dtype(kind).kind == "f":
        return RNG.normal(0, 300, (37, 53)).astype(kind)
    info = np.iinfo(kind)
    found = RNG.integers(info.min, info.max, (37, 53), dtype=kind, endpoint=True)
    found[0, :2] = info.min, info.max
    return found


def read(path: Path) -> NDArray[np.float32]:
    return read_frame(path).observation.image


@pytest.mark.parametrize("kind", ["u1", "u2", "u4", "u8", "i1", "i2", "i4", "i8", "f2", "f4", "f8"])
@pytest.mark.parametrize(
    "layout",
    [{}, {"byteorder": ">"}, {"tile": (16, 32)}, {"rowsperstrip": 5, "bigtiff": True},
     {"compression": "zlib"}],
    ids=["plain", "big-endian", "tiled", "BigTIFF", "deflate"],
)  # fmt: skip
def test_the_numbers_are_the_file_s(kind: str, layout: dict[str, Any], tmp_path: Path) -> None:
    pixels = full_range(kind)
    tifffile.imwrite(tmp_path / "a.tif", pixels, photometric="minisblack", **layout)
    assert np.array_equal(read(tmp_path / "a.tif"), pixels.astype(np.float32))


@pytest.mark.parametrize("compression", ["LZW", "PACKBITS", "DEFLATE"])
@pytest.mark.parametrize("tiled", [False, True])
def test_compressed_ones_too(compression: str, tiled: bool, tmp_path: Path) -> None:
    pixels = full_range("u2")
    options = {"tiled": True, "blockxsize": 16, "blockysize": 16} if tiled else {}
    with rasterio.open(tmp_path / "a.tif", "w", driver="GTiff", width=53, height=37, count=1, dtype="uint16",
                       compress=compression, **options) as file:  # fmt: skip
        file.write(pixels, 1)
    assert np.array_equal(read(tmp_path / "a.tif"), pixels.astype(np.float32))


@pytest.mark.parametrize("bits", [1, 2, 4, 8, 12, 16, 32])
@pytest.mark.parametrize("white", [False, True])
def test_every_depth_and_white_as_zero(bits: int, white: bool, tmp_path: Path) -> None:
    kind = "uint8" if bits <= 8 else "uint16" if bits <= 16 else "uint32"
    pixels = RNG.integers(0, 2**bits - 1, (37, 53), endpoint=True).astype(kind)
    options = {"PHOTOMETRIC": "MINISWHITE"} if white else {}
    with rasterio.open(tmp_path / "a.tif", "w", driver="GTiff", width=53, height=37, count=1, dtype=kind,
                       NBITS=bits, **options) as file:  # fmt: skip
        file.write(pixels, 1)
    shown = (2**bits - 1 - pixels.astype(np.int64)) if white else pixels
    assert np.array_equal(read(tmp_path / "a.tif"), shown.astype(np.float32))


@pytest.mark.parametrize(
    ("pixels", "options", "named"),
    [
        (np.zeros((9, 8, 5), "u1"), {"photometric": "minisblack", "planarconfig": "contig"}, "5 planes.*--plane"),
        (np.zeros((3, 9, 8), "u2"), {"photometric": "minisblack", "planarconfig": "separate"}, "3 planes.*--plane"),
        (np.zeros((5, 9, 8), "f4"), {"photometric": "minisblack"}, r"5 planes: 1 \(page 1\).*--plane"),
        (np.zeros((9, 8), "c8"), {"photometric": "minisblack"}, "complex64"),
        (np.zeros((9, 8), "f4"), {"photometric": "miniswhite"}, "float32 whose zero is white"),
        (np.zeros((9, 8), "u1"), {"photometric": "palette", "colormap": np.zeros((3, 256), "u2")}, "palette"),
    ],
)
def test_what_is_no_one_grey_picture_is_refused_by_name(
    pixels: NDArray[Any], options: dict[str, Any], named: str, tmp_path: Path
) -> None:
    tifffile.imwrite(tmp_path / "a.tif", pixels, **options)
    with pytest.raises(RefusedError, match=rf"a\.tif.*{named}"):
        read_frame(tmp_path / "a.tif")


@pytest.mark.parametrize("kind", ["uint8", "uint16", "float32"])
@pytest.mark.parametrize("big", [False, True])
def test_of_several_pages_the_named_one_is_read(kind: str, big: bool, tmp_path: Path) -> None:
    pages = [(RNG.random((40 + n, 53)) * 200).astype(kind) for n in range(3)]
    with tifffile.TiffWriter(tmp_path / "a.tif", bigtiff=big) as file:
        for number, page in enumerate(pages):
            file.write(page, photometric="minisblack", extratags=[(274, "H", 1, 1 + 2 * (number == 2), True)])
            if number == 0:
                file.write(page[::2, ::2], photometric="minisblack", subfiletype=1)  # a smaller copy is no page
    assert np.array_equal(read_frame(tmp_path / "a.tif", plane="2").observation.image, pages[1].astype("f4"))
    turned = read_frame(tmp_path / "a.tif", plane="page 4")  # the file's fourth picture; stored upside down
    assert np.array_equal(turned.observation.image, pages[2][::-1, ::-1].astype("f4"))
    with pytest.raises(RefusedError, match="there is no plane '4'"):
        read_frame(tmp_path / "a.tif", plane="4")


@pytest.mark.parametrize("place", [2**63, 2**64 - 1, 10**12])
def test_a_directory_that_lies_beyond_all_files_is_damage(place: int, tmp_path: Path) -> None:
    tifffile.imwrite(tmp_path / "a.tif", full_range("u2"), bigtiff=True, byteorder="<")
    content = bytearray((tmp_path / "a.tif").read_bytes())
    content[8:16] = place.to_bytes(8, "little")
    (tmp_path / "a.tif").write_bytes(content)
    with pytest.raises(RefusedError, match=r"a\.tif"):
        read_frame(tmp_path / "a.tif")


def test_bands_of_several_pages_are_planes(tmp_path: Path) -> None:
    pages = [RNG.integers(0, 200, (2, 20, 30)).astype("u1") for _ in range(2)]
    with tifffile.TiffWriter(tmp_path / "a.tif") as file:
        for page in pages:
            file.write(page, photometric="minisblack", planarconfig="separate")
    with pytest.raises(RefusedError, match=r"4 planes: 1 \(page 1 band 1\)"):
        read_frame(tmp_path / "a.tif")
    assert np.array_equal(read_frame(tmp_path / "a.tif", plane="page 2 band 1").observation.image, pages[1][0])


@pytest.mark.parametrize("orientation", range(1, 9))
def test_the_first_line_is_where_the_file_says(orientation: int, tmp_path: Path) -> None:
    pixels = full_range("u1")
    tifffile.imwrite(tmp_path / "a.tif", pixels, extratags=[(274, "H", 1, orientation, True)])
    tag = Image.Exif()
    tag[274] = orientation
    stored = Image.fromarray(pixels)
    stored.getexif()[274] = orientation
    assert np.array_equal(read(tmp_path / "a.tif"), np.asarray(ImageOps.exif_transpose(stored)))


def test_no_data_and_strips_that_were_never_written_are_missing(tmp_path: Path) -> None:
    pixels = full_range("i2")
    options: dict[str, Any] = {"driver": "GTiff", "width": 53, "height": 64, "count": 1, "dtype": "int16"}
    with rasterio.open(tmp_path / "a.tif", "w", nodata=-7, SPARSE_OK=True, blockysize=16, **options) as file:
        file.write(np.full((16, 53), 5, "i2"), 1, window=((0, 16), (0, 53)))
        pixels = np.full((16, 53), 6, "i2")
        pixels[3, 4] = -7
        file.write(pixels, 1, window=((32, 48), (0, 53)))
    missing = read_frame(tmp_path / "a.tif").observation.quality == Quality.MISSING
    expected = np.zeros((64, 53), bool)
    expected[16:32] = expected[48:] = expected[35, 4] = True
    assert np.array_equal(missing, expected)


@pytest.mark.parametrize("cut", [3, 9, 100, 2000])
def test_a_cut_file_is_refused_by_name(cut: int, tmp_path: Path) -> None:
    tifffile.imwrite(tmp_path / "a.tif", full_range("u2"))
    whole = (tmp_path / "a.tif").read_bytes()
    (tmp_path / "a.tif").write_bytes(whole[:-cut])
    with pytest.raises(RefusedError, match=r"a\.tif"):
        read_frame(tmp_path / "a.tif")


@pytest.mark.parametrize("bits", [2, 4, 8])
def test_png_of_every_depth(bits: int, tmp_path: Path) -> None:
    pixels = RNG.integers(0, 2**bits - 1, (37, 53), endpoint=True).astype("u1")
    with rasterio.open(tmp_path / "a.tif", "w", driver="GTiff", width=53, height=37, count=1, dtype="uint8",
                       NBITS=bits) as file:  # fmt: skip
        file.write(pixels, 1)
    rasterio.shutil.copy(tmp_path / "a.tif", tmp_path / "a.png", driver="PNG", NBITS=bits)
    assert np.array_equal(read(tmp_path / "a.png"), pixels.astype(np.float32))


@pytest.mark.parametrize("kind", ["u1", "u2"])
@pytest.mark.parametrize("suffix", ["png", "tif"])
def test_colours_become_grey_and_that_is_said(kind: str, suffix: str, tmp_path: Path) -> None:
    """Equal channels are the picture itself; others are averaged, or one of them is taken by its name or number."""
    grey, colours = full_range(kind), np.stack([full_range(kind)[::step] for step in (1, -1, 1)], axis=-1)
    colours[..., 2] //= 3
    for name, channels in (("grey", np.stack([grey] * 3, axis=-1)), ("colours", colours)):
        with rasterio.open(tmp_path / f"{name}.tif", "w", driver="GTiff", width=grey.shape[1], height=grey.shape[0],
                           count=3, dtype=grey.dtype, photometric="RGB") as file:  # fmt: skip
            file.write(np.moveaxis(channels, -1, 0))
        if suffix == "png":
            rasterio.shutil.copy(tmp_path / f"{name}.tif", tmp_path / f"{name}.png", driver="PNG")
    plain, mixed = read_frame(tmp_path / f"grey.{suffix}"), read_frame(tmp_path / f"colours.{suffix}")
    assert np.array_equal(plain.observation.image, grey.astype(np.float32))
    assert plain.warnings == ()
    assert np.allclose(mixed.observation.image, colours.mean(axis=-1), rtol=1e-6)
    assert any("averaged to grey" in warning for warning in mixed.warnings)
    for plane in ("2", "green"):
        chosen = read_frame(tmp_path / f"colours.{suffix}", plane=plane)
        assert np.array_equal(chosen.observation.image, colours[..., 1].astype(np.float32))
        assert chosen.warnings == ()


@pytest.mark.parametrize("mode", ["LA", "RGBA"])
def test_transparent_pixels_are_missing(mode: str, tmp_path: Path) -> None:
    pixels = np.full((40, 40, len(mode)), 90, np.uint8)
    pixels[:9, :, -1] = 0
    Image.fromarray(pixels, mode).save(tmp_path / "a.png")
    frame = read_frame(tmp_path / "a.png")
    assert np.array_equal(frame.observation.quality & Quality.MISSING > 0, pixels[..., -1] == 0)
    assert np.all(frame.observation.image == 90)


@pytest.mark.parametrize(("kind", "offset"), [("u4", 2**32 - 5000), ("i4", -(2**31)), ("u8", 2**60), ("f8", 1e12)])
def test_contrast_far_from_zero_is_refused_rather_than_lost(kind: str, offset: float, tmp_path: Path) -> None:
    """Single precision has steps of 128 to 256 at 4e9; near zero, or with a contrast of that size, nothing is lost."""
    near = np.random.default_rng(0).integers(0, 4000, (64, 64))
    tifffile.imwrite(tmp_path / "near.tif", near.astype(kind))
    assert np.array_equal(read_frame(tmp_path / "near.tif").observation.image, near)
    tifffile.imwrite(tmp_path / "wide.tif", (near.astype(kind) * 500_000))
    assert read_frame(tmp_path / "wide.tif").observation.image.max() == pytest.approx(near.max() * 5e5, rel=1e-6)
    tifffile.imwrite(tmp_path / "far.tif", near.astype(kind) + np.array(offset).astype(kind))
    with pytest.raises(RefusedError, match=r"far\.tif.*further from zero than apart.*Subtract a constant"):
        read_frame(tmp_path / "far.tif")
