"""One picture in every format that people have on disk: the same pixels, and what the label says."""

import bz2
import gzip
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from astropy.io import fits
from formats import isis_cube, pds3_label, pds4_label
from numpy.typing import NDArray
from PIL import Image

from catalog.camera import find_camera
from catalog.errors import RefusedError
from catalog.image_mode import ImageMode
from catalog.lists.scan import looks_like_an_image
from catalog.observation import Quality
from catalog.readers import read_frame
from catalog.readers.pds3_array import special_value

LINES, SAMPLES = 60, 77
PICTURE = np.random.default_rng(1).integers(20, 4000, (LINES, SAMPLES))
TIME = "2000-05-22T23:52:05.277"
KINDS = ["u1", "<i2", ">i2", "<u2", ">u2", "<i4", ">i4", "<f4", ">f4", "<f8", ">f8"]


def of_kind(kind: str) -> NDArray[Any]:
    return (PICTURE % 230 + 5 if kind == "u1" else PICTURE).astype(kind)


def same(path: Path, pixels: NDArray[Any], **options: Any) -> None:
    found = read_frame(path, **options).observation
    assert np.array_equal(found.image, pixels.astype(np.float32))


@pytest.mark.parametrize("tile", [None, (16, 25), (60, 77), (128, 128)])
@pytest.mark.parametrize("kind", KINDS)
def test_isis_cubes(kind: str, tile: tuple[int, int] | None, tmp_path: Path) -> None:
    pixels = of_kind(kind)
    (tmp_path / "a.cub").write_bytes(isis_cube(pixels[None], tile))
    same(tmp_path / "a.cub", pixels)
    frame = read_frame(tmp_path / "a.cub")
    assert (frame.target, frame.exposure_s, frame.filter) == ("europa", 0.00625, "GREEN")
    assert frame.sources["time"] == "START_TIME"
    if kind[-2:] in ("u1", "i2", "u2", "f4"):  # GDAL reads the same
        with rasterio.open(tmp_path / "a.cub") as other:
            assert np.array_equal(other.read(1), pixels.astype(pixels.dtype.newbyteorder("=")))


@pytest.mark.parametrize("tiled", ["YES", "NO"])
def test_isis_cubes_as_gdal_writes_them(tiled: str, tmp_path: Path) -> None:
    options = {"TILED": tiled, "BLOCKXSIZE": 32, "BLOCKYSIZE": 32} if tiled == "YES" else {}
    with rasterio.open(tmp_path / "a.cub", "w", driver="ISIS3", width=SAMPLES, height=LINES, count=2, dtype="int16",
                       **options) as file:  # fmt: skip
        file.write(np.stack([PICTURE, PICTURE[::-1]]).astype("i2"))
    for plane, pixels in (("1", PICTURE), ("2", PICTURE[::-1])):
        same(tmp_path / "a.cub", pixels, plane=plane)


@pytest.mark.parametrize("kind", ["u1", "<i2", "<u2", "<f4", ">f8"])
def test_special_pixels_and_scaling_of_isis(kind: str, tmp_path: Path) -> None:
    special = {
        "u1": ([0], [255]),
        "i2": ([-32768, -32767, -32766], [-32765, -32764]),
        "u2": ([0, 1, 2], [65534, 65535]),
        "f4": ([0xFF7FFFFB, 0xFF7FFFFC, 0xFF7FFFFD], [0xFF7FFFFE, 0xFF7FFFFF]),
        "f8": ([0xFFEFFFFFFFFFFFFB + n for n in range(3)], [0xFFEFFFFFFFFFFFFE, 0xFFEFFFFFFFFFFFFF]),
    }[kind[-2:]]
    pixels = of_kind(kind)
    native = pixels.astype(pixels.dtype.newbyteorder("="))
    for column, values in enumerate(special):
        words = np.array(values, f"u{native.itemsize}" if "f" in kind else native.dtype).view(native.dtype)
        native[: len(values), column] = words
    stored = native.astype(kind) if kind[1] != "f" else native.view(f"u{native.itemsize}").astype(
        kind.replace("f", "u")).view(kind)  # fmt: skip
    (tmp_path / "a.cub").write_bytes(isis_cube(stored[None], None, base=10.0, multiplier=0.5))
    observation = read_frame(tmp_path / "a.cub").observation
    lost, bright = (np.zeros(pixels.shape, bool) for _ in range(2))
    lost[: len(special[0]), 0], bright[: len(special[1]), 1] = True, True
    assert np.array_equal(observation.quality & Quality.MISSING > 0, lost)
    assert np.array_equal(observation.quality & Quality.SATURATED > 0, bright)
    plain = ~lost & ~bright
    assert np.allclose(observation.image[plain], 10 + 0.5 * pixels[plain].astype(float), rtol=1e-6)


PDS3_TYPES = {
    "u1": "UNSIGNED_INTEGER", "<i2": "LSB_INTEGER", ">i2": "MSB_INTEGER", "<u2": "PC_UNSIGNED_INTEGER",
    ">u2": "SUN_UNSIGNED_INTEGER", "<i4": "VAX_INTEGER", ">i4": "INTEGER", "<f4": "PC_REAL", ">f4": "IEEE_REAL",
    "<f8": "PC_REAL", ">f8": "SUN_REAL",
}  # fmt: skip


@pytest.mark.parametrize("attached", [True, False])
@pytest.mark.parametrize("kind", KINDS)
def test_pds3_images_of_every_sample_type(kind: str, attached: bool, tmp_path: Path) -> None:
    pixels = of_kind(kind)
    label, body = pds3_label(pixels[None], PDS3_TYPES[kind], None if attached else "A.IMG", prefix=6, suffix=10)
    if attached:
        (tmp_path / "a.img").write_bytes(label + body)
    else:
        (tmp_path / "a.lbl").write_bytes(label)
        (tmp_path / "a.img").write_bytes(body)
        same(tmp_path / "a.lbl", pixels)  # the label names it in capitals
    same(tmp_path / "a.img", pixels)
    assert read_frame(tmp_path / "a.img").target == "europa"


@pytest.mark.parametrize("order", ["BAND_SEQUENTIAL", "LINE_INTERLEAVED", "SAMPLE_INTERLEAVED"])
def test_bands_of_pds3_images_in_every_order(order: str, tmp_path: Path) -> None:
    bands = np.stack([PICTURE, PICTURE[::-1], PICTURE[:, ::-1]]).astype(">i2")
    label, body = pds3_label(bands, "MSB_INTEGER", None, order=order, names=("RED", "GREEN", "BLUE"))
    (tmp_path / "a.img").write_bytes(label + body)
    for number, name in enumerate(("RED", "green", "3")):
        same(tmp_path / "a.img", bands[number], plane=name)
    with pytest.raises(RefusedError, match=r"3 planes: 1 \(RED\), 2 \(GREEN\), 3 \(BLUE\).*--plane"):
        read_frame(tmp_path / "a.img")


def test_scaling_and_missing_values_of_pds3(tmp_path: Path) -> None:
    pixels = of_kind("<i2")
    pixels[3, 4], pixels[5, 6] = -32768, 9999
    more = "OFFSET = 10.0\r\n SCALING_FACTOR = 0.25\r\n MISSING_CONSTANT = -32768\r\n SATURATED_CONSTANT = 9999"
    label, body = pds3_label(pixels[None], "LSB_INTEGER", None, more=more)
    (tmp_path / "a.img").write_bytes(label + body)
    observation = read_frame(tmp_path / "a.img").observation
    assert np.argwhere(observation.quality & Quality.MISSING).tolist() == [[3, 4]]
    assert np.argwhere(observation.quality & Quality.SATURATED).tolist() == [[5, 6]]
    assert np.allclose(observation.image, 10 + pixels * 0.25)


@pytest.mark.parametrize("axes", [("Line", "Sample"), ("Band", "Line", "Sample"), ("Line", "Sample", "Band")])
@pytest.mark.parametrize("kind", KINDS)
def test_pds4_images(kind: str, axes: tuple[str, ...], tmp_path: Path) -> None:
    pixels = of_kind(kind)
    cube = pixels if len(axes) == 2 else np.stack([pixels, pixels[::-1]], axis=axes.index("Band"))
    (tmp_path / "a.xml").write_text(pds4_label(cube, axes, "a_data.img", offset=100))
    (tmp_path / "a_data.img").write_bytes(bytes(100) + cube.tobytes())
    plane = None if len(axes) == 2 else "1"
    same(tmp_path / "a.xml", pixels, plane=plane)
    (tmp_path / "a_data.img").rename(tmp_path / "a.img")
    (tmp_path / "a.xml").write_text(pds4_label(cube, axes, "a.img", offset=100))
    same(tmp_path / "a.img", pixels, plane=plane)
    frame = read_frame(tmp_path / "a.img", plane=plane)
    assert (frame.target, frame.exposure_s) == ("europa", 0.25)
    assert frame.sources["time"] == "start_date_time and stop_date_time"


def test_a_pds4_array_of_samples_before_lines_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.xml").write_text(pds4_label(of_kind("u1"), ("Sample", "Line"), "a.img"))
    (tmp_path / "a.img").write_bytes(of_kind("u1").tobytes())
    with pytest.raises(RefusedError, match="lines before samples"):
        read_frame(tmp_path / "a.xml")


@pytest.mark.parametrize(
    ("value", "kind", "expected"),
    [
        (float("inf"), "i2", None), (float("nan"), ">f4", None), (int("F" * 20, 16), ">f4", None), (True, "u1", None),
        (70000, "i2", None), (-32768.0, "i2", -32768), ("16#FF7FFFFB#", ">f8", -3.4028227e38),
        (0xFF7FFFFB, ">f4", -3.4028227e38), (0xFFEFFFFFFFFFFFFB, ">f8", -1.7976931348623149e308),
        ("-1.0E32", "f4", -1e32),
    ],
)  # fmt: skip
def test_special_values_of_labels(value: Any, kind: str, expected: float | None) -> None:
    found = special_value(value, np.dtype(kind))
    assert found is None if expected is None else found == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("chunk", [1, 2, 7])
@pytest.mark.parametrize("pack", [gzip.compress, bz2.compress])
def test_members_that_begin_at_the_end_of_a_chunk(
    pack: Callable[[bytes], bytes], chunk: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    np.save(tmp_path / "a.npy", PICTURE.astype("i2"))
    content = (tmp_path / "a.npy").read_bytes()
    first = pack(content[:1000])
    (tmp_path / "b.npy.packed").write_bytes(first + pack(content[1000:]))
    monkeypatch.setattr("catalog.packed.CHUNK_BYTES", len(first) + chunk)
    same(tmp_path / "b.npy.packed", PICTURE.astype("i2"))


@pytest.mark.parametrize("pack", [gzip.compress, bz2.compress])
def test_a_folder_is_searched_for_packed_images_too(pack: Callable[[bytes], bytes], tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", PICTURE.astype("i2"))
    content = (tmp_path / "a.npy").read_bytes()
    packed = {"a.packed": pack(content), "notes.packed": pack(b"a text"), "cut.packed": pack(content)[:8]}
    for name, part in packed.items():
        (tmp_path / name).write_bytes(part)
    assert [name for name in sorted(packed) if looks_like_an_image(tmp_path / name)] == ["a.packed"]


KEYWORDS = """Object = NaifKeywords
  INS-999001_FOCAL_LENGTH     = 100.0
  INS-999001_PIXEL_PITCH      = 0.01
  INS-999001_BORESIGHT_SAMPLE = 30.0
  INS-999001_BORESIGHT_LINE   = 20.0
End_Object
End
"""


def cube_with_keywords(keywords: str) -> bytes:
    cube = isis_cube(of_kind("<i2")[None], None, more="Group = Kernels\n NaifFrameCode = -999001\nEnd_Group")
    label, rest = cube[:4096].rstrip(b"\0"), cube[4096:]
    return (label.removesuffix(b"End\n") + keywords.encode()).ljust(4096, b"\0") + rest


def test_a_cube_carries_the_camera_that_the_catalog_lacks(tmp_path: Path) -> None:
    path = tmp_path / "a.cub"
    path.write_bytes(cube_with_keywords(KEYWORDS))
    frame = read_frame(path)
    assert frame.camera == f"isis:{path}"
    assert frame.sources["camera"] == "NaifKeywords"
    camera = find_camera(frame.camera)
    assert camera.centre_px == (29.0, 19.0)
    assert camera.size_px == (SAMPLES, LINES)
    assert read_frame(path, "cassini-nac", mode=ImageMode(1, (0, 0, SAMPLES, LINES))).camera == "cassini-nac"
    (tmp_path / "b.cub.gz").write_bytes(gzip.compress(path.read_bytes()))
    packed = read_frame(tmp_path / "b.cub.gz").camera
    assert packed == f"isis:{tmp_path / 'b.cub.gz'}"
    assert find_camera(packed).centre_px == camera.centre_px


@pytest.mark.parametrize(
    ("old", "new", "fault"),
    [
        ("FOCAL_LENGTH ", "OTHER_LENGTH ", "focal length"),
        ("PIXEL_PITCH      = 0.01", "PIXEL_PITCH = 1e400", "pixels' size"),
        ("End_Object", "INS-999001_TRANSX = (0, 1, 1)\nINS-999001_TRANSY = (0, 2, 2)\nEnd_Object", "onto one line"),
        ("End_Object", "INS-999001_PIXEL_SAMPLES = 1e400\nINS-999001_PIXEL_LINES = 9\nEnd_Object", "make no camera"),
    ],
)
def test_keywords_that_make_no_camera_say_why(old: str, new: str, fault: str, tmp_path: Path) -> None:
    (tmp_path / "a.cub").write_bytes(cube_with_keywords(KEYWORDS.replace(old, new)))
    frame = read_frame(tmp_path / "a.cub")
    assert frame.camera is None
    assert fault in frame.unclear["camera"]
    with pytest.raises(RefusedError, match=fault):
        find_camera(f"isis:{tmp_path}/a.cub")


def test_a_label_whose_image_is_a_fits_file(tmp_path: Path) -> None:
    """The FITS file is read as such; what its header does not say is taken from the label."""
    fits.PrimaryHDU(PICTURE.astype("i2")).writeto(tmp_path / "a.fits")
    (tmp_path / "a.xml").write_text(pds4_label(PICTURE.astype(">i2"), ("Line", "Sample"), "a.fits", offset=2880))
    for name in ("a.xml", "a.fits"):
        frame = read_frame(tmp_path / name)
        assert (frame.format, frame.target) == ("fits", "europa")
        assert frame.sources["target"] == "Target_Identification in a.xml"
        same(tmp_path / name, PICTURE)


@pytest.mark.parametrize("name", ["../a.img", "/etc/passwd", "sub/a.img", "http://a.b/c.img", "missing.img"])
def test_a_label_is_not_followed_out_of_its_folder(name: str, tmp_path: Path) -> None:
    (tmp_path / "sub").mkdir()
    for place in (tmp_path / "a.img", tmp_path / "sub" / "a.img"):
        place.write_bytes(PICTURE.astype("u1").tobytes())
    pixels = PICTURE.astype("u1")
    (tmp_path / "sub" / "b.xml").write_text(pds4_label(pixels, ("Line", "Sample"), name))
    (tmp_path / "sub" / "b.lbl").write_bytes(pds3_label(pixels[None], "UNSIGNED_INTEGER", name)[0])
    for label in ("b.xml", "b.lbl"):
        with pytest.raises(RefusedError, match="not beside it") as refusal:
            read_frame(tmp_path / "sub" / label)
        assert refusal.value.code == "image-missing"


PACKERS: dict[str, Callable[[bytes], bytes]] = {
    "gz": gzip.compress,
    "bz2": bz2.compress,
    "parts.gz": lambda content: gzip.compress(content[:900]) + gzip.compress(content[900:]) + b"\0",
}


@pytest.mark.parametrize("packer", list(PACKERS))
def test_anything_packed(packer: str, tmp_path: Path) -> None:
    pixels = of_kind(">i2")
    fits.PrimaryHDU(pixels).writeto(tmp_path / "a.fits")
    (tmp_path / "a.cub").write_bytes(isis_cube(pixels[None], None))
    label, body = pds3_label(pixels[None], "MSB_INTEGER", "b.img")
    (tmp_path / "b.lbl").write_bytes(label)
    (tmp_path / "b.img").write_bytes(body)
    for name in ("a.fits", "a.cub", "b.img"):
        packed = tmp_path / f"{name}.{packer.rpartition('.')[2]}"
        packed.write_bytes(PACKERS[packer]((tmp_path / name).read_bytes()))
        (tmp_path / name).unlink()
        same(packed, pixels)
        assert read_frame(packed).path == packed
        packed.write_bytes(packed.read_bytes()[:-400])
        with pytest.raises(RefusedError, match=re.escape(packed.name)):
            read_frame(packed)


@pytest.mark.parametrize("kind", ["GZIP_1", "RICE_1", "HCOMPRESS_1", "PLIO_1"])
def test_tile_compressed_fits(kind: str, tmp_path: Path) -> None:
    pixels = PICTURE.astype("i2")
    fits.HDUList([fits.PrimaryHDU(), fits.CompImageHDU(pixels, compression_type=kind)]).writeto(tmp_path / "a.fits")
    same(tmp_path / "a.fits", pixels)


def test_planes_of_fits_by_number_and_name(tmp_path: Path) -> None:
    cube = np.stack([PICTURE, PICTURE[::-1], PICTURE[:, ::-1]]).astype("f4")
    hdus = [fits.PrimaryHDU(), fits.ImageHDU(cube, name="SCI"), fits.ImageHDU(cube[2] + 1, name="OTHER")]
    fits.HDUList(hdus).writeto(tmp_path / "a.fits")
    for plane, pixels in (("2", cube[1]), ("sci:3", cube[2]), ("other", cube[2] + 1), ("4", cube[2] + 1)):
        same(tmp_path / "a.fits", pixels, plane=plane)
    with pytest.raises(RefusedError, match=r"4 planes: 1 \(SCI:1\).*4 \(OTHER\).*--plane") as refusal:
        read_frame(tmp_path / "a.fits")
    assert refusal.value.code == "several-planes"
    with pytest.raises(RefusedError, match=r"no plane 'B'.*SCI:1"):
        read_frame(tmp_path / "a.fits", plane="B")
    fits.HDUList([fits.PrimaryHDU(), fits.ImageHDU(cube), fits.ImageHDU(PICTURE)]).writeto(tmp_path / "nameless.fits")
    with pytest.raises(RefusedError, match=r"it has 4 planes: 1, 2, 3, 4\. "):
        read_frame(tmp_path / "nameless.fits")


@pytest.mark.parametrize("kind", ["<i2", ">i2", "i4"])
def test_the_lowest_number_of_signed_samples_is_no_data(kind: str, tmp_path: Path) -> None:
    pixels = PICTURE.astype(kind)
    pixels[5, 7] = pixels[20, 3] = np.iinfo(kind).min
    np.save(tmp_path / "a.npy", pixels)
    missing = read_frame(tmp_path / "a.npy").observation.quality & Quality.MISSING > 0
    assert np.argwhere(missing).tolist() == [[5, 7], [20, 3]]


@pytest.mark.parametrize("sky", [0, 7])
def test_what_follows_the_pixels_of_fits(sky: int, tmp_path: Path) -> None:
    """A byte or a block more is no fault; bytes lost or put in are, wherever that can be seen."""
    pixels = PICTURE.astype("i2")
    pixels[-20:] = sky
    fits.PrimaryHDU(pixels).writeto(tmp_path / "a.fits")
    content = (tmp_path / "a.fits").read_bytes()
    for more in (b"\n", b"\0", b" ", bytes(2880), b"x" * 2880, b"end of file\n"):
        (tmp_path / "b.fits").write_bytes(content + more)
        same(tmp_path / "b.fits", pixels)
    for place in (2881, 4000, 6000):
        for damaged in (content[:place] + content[place + 100 :], content[:place] + b"x" * 100 + content[place:]):
            (tmp_path / "b.fits").write_bytes(damaged)
            with pytest.raises(RefusedError, match=r"b\.fits"):
                read_frame(tmp_path / "b.fits")


@pytest.mark.parametrize("order", ["C", "F"])
@pytest.mark.parametrize("kind", KINDS)
def test_npy(kind: str, order: Any, tmp_path: Path) -> None:
    pixels = np.asarray(of_kind(kind), order=order)
    np.save(tmp_path / "a.npy", pixels)
    same(tmp_path / "a.npy", pixels)


@pytest.mark.parametrize("planes", [2, 3, 4])
def test_npy_of_colours_has_its_planes_last(planes: int, tmp_path: Path) -> None:
    pixels = np.stack([PICTURE + 3 * each for each in range(planes)], axis=-1).astype("f4")
    np.save(tmp_path / "a.npy", pixels)
    for each in range(planes):
        same(tmp_path / "a.npy", pixels[..., each], plane=str(each + 1))
    with pytest.raises(RefusedError, match=f"it has {planes} planes"):
        read_frame(tmp_path / "a.npy")


def test_npy_with_objects_is_never_loaded(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.array([[{}, print]], object), allow_pickle=True)
    with pytest.raises(RefusedError, match=r"a\.npy.*np\.save"):
        read_frame(tmp_path / "a.npy")


def test_jpeg_is_read_with_a_warning(tmp_path: Path) -> None:
    smooth = np.add.outer(np.arange(LINES), np.arange(SAMPLES)).astype("u1")
    Image.fromarray(smooth).save(tmp_path / "a.jpg", quality=98)
    frame = read_frame(tmp_path / "a.jpg")
    assert np.abs(frame.observation.image - smooth).max() <= 3
    assert any("losses" in warning for warning in frame.warnings)


WHOLE: dict[str, Callable[[], bytes]] = {
    "a.cub": lambda: isis_cube(of_kind("<i2")[None], None),
    "tiled.cub": lambda: isis_cube(of_kind("<i2")[None], (16, 25)),
    "a.img": lambda: b"".join(pds3_label(of_kind(">i2")[None], "MSB_INTEGER", None)),
    "a.npy": lambda: b"\x93NUMPY\1\0" + (76).to_bytes(2, "little") + (
        f"{{'descr': '<i2', 'fortran_order': False, 'shape': ({LINES}, {SAMPLES}), }}".encode().ljust(76)
        + of_kind("<i2").tobytes()),
}  # fmt: skip


@pytest.mark.parametrize("name", list(WHOLE))
def test_truncated_and_shifted_files_are_refused(name: str, tmp_path: Path) -> None:
    content = WHOLE[name]()
    (tmp_path / name).write_bytes(content)
    same(tmp_path / name, of_kind("<i2"))
    (tmp_path / name).write_bytes(content + b"\n")
    same(tmp_path / name, of_kind("<i2"))
    middle = len(content) - 3000
    for damaged in (content[:-1], content[: len(content) // 2], content[:middle] + b"xyz" + content[middle:],
                    content[:middle] + content[middle + 5 :]):  # fmt: skip
        (tmp_path / name).write_bytes(damaged)
        with pytest.raises(RefusedError, match=name) as refusal:
            read_frame(tmp_path / name)
        assert refusal.value.remedy


def test_a_given_mode_is_kept_where_no_camera_is_known(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", PICTURE)
    mode = ImageMode(2, None, "--summing and --window")
    assert read_frame(tmp_path / "a.npy", mode=mode).mode == mode
