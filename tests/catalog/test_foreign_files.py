"""Files as other people's programs write them: the pixels are those that the writer was given."""

import gzip
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
import rasterio.shutil
from astropy.io import fits
from formats import pds4_label
from numpy.typing import NDArray
from PIL import Image, ImageOps

from catalog.errors import RefusedError
from catalog.observation import Quality
from catalog.readers import read_frame

LINES, SAMPLES = 40, 50
BANDS = np.random.default_rng(3).integers(300, 9000, (3, LINES, SAMPLES)).astype("i2")
IMAGE_OBJECT = """OBJECT = IMAGE
 LINES = 40
 LINE_SAMPLES = 50
 SAMPLE_TYPE = LSB_INTEGER
 SAMPLE_BITS = 16
END_OBJECT = IMAGE
"""


def same(path: Path, pixels: NDArray[Any], **options: Any) -> None:
    assert np.array_equal(read_frame(path, **options).observation.image, pixels.astype(np.float32))


def by_gdal(path: Path, driver: str, bands: NDArray[Any], **options: Any) -> Path:
    """The bands (bands, lines, samples) in a file that GDAL's driver writes."""
    count, lines, samples = bands.shape
    kind = bands.dtype.newbyteorder("=").name
    with rasterio.open(path, "w", driver=driver, width=samples, height=lines, count=count, dtype=kind, **options) as f:
        f.write(bands)
    return path


def vicar(bands: NDArray[Any], order: str, prefix: int, header_records: int) -> bytes:
    """A VICAR file of three bands in one of its orders, every record with a prefix (VICAR File Format, JPL D-4186)."""
    axes = {"BSQ": (0, 1, 2), "BIL": (1, 0, 2), "BIP": (1, 2, 0)}[order]
    stored = np.ascontiguousarray(bands.transpose(axes))
    records = stored.reshape(-1, stored.shape[2])
    kind = {"u1": "BYTE", "i2": "HALF", "f4": "REAL"}[stored.dtype.str[1:]]
    byte_order = "HIGH" if stored.dtype.str[0] == ">" else "LOW"
    size = prefix + stored.shape[2] * stored.itemsize
    label = (
        f"TYPE='IMAGE'  FORMAT='{kind}'  DIM=3  EOL=0  RECSIZE={size}  ORG='{order}'  NL={bands.shape[1]}"
        f"  NS={bands.shape[2]}  NB={bands.shape[0]}  N1={stored.shape[2]}  N2={stored.shape[1]}  N3={stored.shape[0]}"
        f"  NBB={prefix}  NLB={header_records}  INTFMT='{byte_order}'  REALFMT='{'R' * (byte_order == 'LOW')}IEEE'"
    )
    label_bytes = -(-(len(label) + 30) // size) * size
    head = f"LBLSIZE={label_bytes:<10d}  {label}".encode().ljust(label_bytes, b"\0")
    return head + b"h" * size * header_records + b"".join(b"p" * prefix + record.tobytes() for record in records)


@pytest.mark.parametrize("prefix", [0, 6])
@pytest.mark.parametrize("kind", ["u1", ">i2", "<f4"])
@pytest.mark.parametrize("order", ["BSQ", "BIL", "BIP"])
def test_vicar_of_several_bands(order: str, kind: str, prefix: int, tmp_path: Path) -> None:
    bands = (BANDS % 250).astype(kind)
    path = tmp_path / "a.vic"
    path.write_bytes(vicar(bands, order, prefix, 2))
    for band in range(3):
        same(path, bands[band], plane=str(band + 1))
    with pytest.raises(RefusedError, match="3 planes"):
        read_frame(path)
    path.write_bytes(vicar(bands[:1], order, prefix, 1) + b"\n")  # one band needs no choice
    same(path, bands[0])


def test_vicar_of_gdal(tmp_path: Path) -> None:
    same(by_gdal(tmp_path / "a.vic", "VICAR", BANDS), BANDS[2], plane="3")


@pytest.mark.parametrize("coding", ["BASIC", "BASIC2"])
def test_packed_vicar_is_refused_with_a_remedy_that_works(coding: str, tmp_path: Path) -> None:
    by_gdal(tmp_path / "a.tif", "GTiff", BANDS[:1])
    rasterio.shutil.copy(tmp_path / "a.tif", tmp_path / "a.vic", driver="VICAR", COMPRESS=coding)
    with pytest.raises(RefusedError, match=f"coded .{coding}.") as refusal:
        read_frame(tmp_path / "a.vic")
    assert "gdal_translate -of VICAR" in refusal.value.remedy
    rasterio.shutil.copy(tmp_path / "a.vic", tmp_path / "b.vic", driver="VICAR")
    same(tmp_path / "b.vic", BANDS[0])


@pytest.mark.parametrize("pointer", ["1001 <BYTES>", "1001 <bytes>", "11", '"a.img"', '("a.img", 301 <BYTES>)'])
@pytest.mark.parametrize("added", [b"", b"\r\n"])
def test_pointers_of_pds3(pointer: str, added: bytes, tmp_path: Path) -> None:
    label = f"PDS_VERSION_ID = PDS3\nRECORD_BYTES = 100\n^IMAGE = {pointer}\nTARGET_NAME = EUROPA\n{IMAGE_OBJECT}END\n"
    pixels = BANDS[0].astype("<i2").tobytes() + added
    if "img" in pointer:
        (tmp_path / "a.img").write_bytes(b"x" * (300 if "301" in pointer else 0) + pixels)
        (tmp_path / "a.lbl").write_text(label)
        same(tmp_path / "a.lbl", BANDS[0])
    else:
        (tmp_path / "a.img").write_bytes(label.encode().ljust(1000) + pixels)
    same(tmp_path / "a.img", BANDS[0])


@pytest.mark.parametrize("name", ["FILE", "UNCOMPRESSED_FILE"])
def test_an_image_inside_an_object_of_its_file(name: str, tmp_path: Path) -> None:
    (tmp_path / "a.lbl").write_text(
        f'PDS_VERSION_ID = PDS3\nTARGET_NAME = EUROPA\nOBJECT = {name}\nRECORD_BYTES = 100\n^IMAGE = ("a.img", 4)\n'
        f"{IMAGE_OBJECT}END_OBJECT = {name}\nEND\n"
    )
    (tmp_path / "a.img").write_bytes(bytes(300) + BANDS[0].astype("<i2").tobytes())
    same(tmp_path / "a.lbl", BANDS[0])
    same(tmp_path / "a.img", BANDS[0])
    assert read_frame(tmp_path / "a.img").target == "europa"


@pytest.mark.parametrize("location", ["EXTERNAL", "GEOTIFF"])
def test_a_detached_isis_label_by_either_file(location: str, tmp_path: Path) -> None:
    by_gdal(tmp_path / "a.lbl", "ISIS3", BANDS[:1], DATA_LOCATION=location)
    pixels = tmp_path / ("a.cub" if location == "EXTERNAL" else "a.tif")
    same(tmp_path / "a.lbl", BANDS[0])
    same(pixels, BANDS[0])


@pytest.mark.parametrize("packed", [False, True])
@pytest.mark.parametrize("suffix", [".xml", ".lblx"])
def test_names_of_pds4_labels(suffix: str, packed: bool, tmp_path: Path) -> None:
    pixels = BANDS[0].astype("<i2")
    label = tmp_path / f"a{suffix}"
    label.write_text(pds4_label(pixels, ("Line", "Sample"), "a.img"))
    data = tmp_path / ("a.img.gz" if packed else "a.img")
    data.write_bytes(gzip.compress(pixels.tobytes()) if packed else pixels.tobytes())
    for path in (label, data):
        same(path, pixels)
        assert read_frame(path).target == "europa"


def test_pds4_images_in_several_files(tmp_path: Path) -> None:
    """The second file is a table and has a size of its own, the third another image."""
    first, second = (band.astype("<i2") for band in BANDS[:2])
    text = pds4_label(first, ("Line", "Sample"), "a.img").replace("<Array_2D_Image>", "<Array_2D_Image><name>A</name>")
    area = text[text.index("<File_Area_Observational>") : text.index("</Product_Observational>")]
    table = (
        "<File_Area_Observational><File><file_name>a.tab</file_name><file_size>4</file_size></File><Table_Character/>"
        "</File_Area_Observational>"
    )
    other = area.replace("a.img", "b.img").replace("<name>A<", "<name>B<")
    (tmp_path / "a.xml").write_text(text.replace(area, table + area + other))
    (tmp_path / "a.img").write_bytes(first.tobytes())
    same(tmp_path / "a.xml", first)  # the other file is not there
    (tmp_path / "b.img").write_bytes(second.tobytes())
    same(tmp_path / "a.xml", first)
    same(tmp_path / "a.xml", second, plane="B")


def test_a_pds4_label_without_an_image_says_what_it_has(tmp_path: Path) -> None:
    text = pds4_label(BANDS[0], ("Line", "Sample"), "a.img").replace("Array_2D_Image", "Array_2D_Map")
    (tmp_path / "a.xml").write_text(text)
    with pytest.raises(RefusedError, match=r"describes no image \(only Array_2D_Map\)"):
        read_frame(tmp_path / "a.xml")


def test_the_blank_of_unsigned_fits_images_is_a_stored_number(tmp_path: Path) -> None:
    pixels = BANDS[0].astype("u2")
    pixels[3, 5:9] = 7
    hdu = fits.PrimaryHDU(pixels)
    hdu.header["BLANK"] = 7 - 32768
    hdu.writeto(tmp_path / "a.fits")
    missing = read_frame(tmp_path / "a.fits").observation.quality & Quality.MISSING
    assert np.array_equal(missing != 0, pixels == 7)


@pytest.mark.parametrize("kind", ["u1", "u2"])
def test_the_grey_that_a_png_calls_transparent_is_missing(kind: str, tmp_path: Path) -> None:
    pixels = (BANDS[0] % 250 + 1).astype(kind)
    pixels[4:9, 7:30] = 0
    Image.fromarray(pixels).save(tmp_path / "a.png", transparency=0)
    found = read_frame(tmp_path / "a.png").observation
    assert np.array_equal((found.quality & Quality.MISSING) != 0, pixels == 0)


@pytest.mark.parametrize("turn", range(1, 9))
def test_a_jpeg_s_first_line_is_where_exif_says(turn: int, tmp_path: Path) -> None:
    grey = np.add.outer(np.arange(LINES), np.arange(SAMPLES)).astype("u1") * 2
    tags = Image.Exif()
    tags[274] = turn
    Image.fromarray(grey).save(tmp_path / "a.jpg", quality=100, exif=tags)
    with Image.open(tmp_path / "a.jpg") as picture:
        expected = np.asarray(ImageOps.exif_transpose(picture))
    same(tmp_path / "a.jpg", expected)
