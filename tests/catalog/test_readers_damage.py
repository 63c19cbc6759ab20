"""Whatever is done to a file, only a RefusedError that names it may come out of its reader."""

import os
import re
import zlib
from pathlib import Path

import numpy as np
import pytest
from astropy.io import fits
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image
from small_vicar import VICAR_LABEL, read_or_refuse

from catalog.errors import RefusedError
from catalog.readers import read_frame


def vicar_content() -> bytes:
    return VICAR_LABEL.ljust(800, b"\0") + bytes(60) + bytes(range(60)) * 30 + b"LBLSIZE=100     LAB01='X'".ljust(100)


def fits_content(folder: Path) -> bytes:
    pixels = np.arange(1200, dtype=np.float32).reshape(30, 40)
    planes = [fits.PrimaryHDU(pixels), fits.ImageHDU(pixels, name="NOISE")]
    planes.append(fits.ImageHDU(pixels.astype(np.uint16), name="QUALITY"))
    planes[0].header["CAMERA"] = "galileo-ssi"
    planes[0].header["DATE-OBS"] = "2000-05-22T23:52:05.277"
    fits.HDUList(planes).writeto(folder / "a.fits", overwrite=True)
    return (folder / "a.fits").read_bytes()


def picture_content(folder: Path, name: str) -> bytes:
    Image.fromarray(np.arange(1200, dtype=np.uint16).reshape(30, 40)).save(folder / name)
    return (folder / name).read_bytes()


@st.composite
def damaged(draw: st.DrawFn, content: bytes, head: int) -> bytes:
    """`content` cut, with bytes changed, with a number of its head replaced, or with bytes taken out or put in."""
    place = draw(st.integers(0, min(head, len(content)) - 1))
    kind = draw(st.sampled_from(["cut", "bytes", "number", "number", "remove", "insert"]))
    if kind == "cut":
        return content[: draw(st.integers(0, len(content)))]
    if kind == "bytes":
        new = draw(st.binary(min_size=1, max_size=20))
        return content[:place] + new + content[place + len(new) :]
    if kind == "number":
        match = draw(st.sampled_from(list(re.finditer(rb"\d+", content[:head]))))
        value = draw(st.sampled_from([b"0", b"-1", b"999999999", b"20001", b"1e9", b"'", b"(", b"", b"1.5", b"nan"]))
        end = match.end() if draw(st.booleans()) else match.start() + len(value)
        return content[: match.start()] + value + content[end:]
    if kind == "remove":
        return content[:place] + content[place + draw(st.integers(1, 100)) :]
    return content[:place] + draw(st.binary(min_size=1, max_size=100)) + content[place:]


fuzz = settings(
    max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow]
)


@fuzz
@given(st.data())
def test_damaged_vicar(tmp_path: Path, data: st.DataObject) -> None:
    (tmp_path / "x.img").write_bytes(data.draw(damaged(vicar_content(), 800)))
    read_or_refuse(tmp_path / "x.img")


@fuzz
@given(st.data())
def test_damaged_fits(tmp_path: Path, data: st.DataObject) -> None:
    (tmp_path / "x.fits").write_bytes(data.draw(damaged(fits_content(tmp_path), 2000)))
    read_or_refuse(tmp_path / "x.fits")


@fuzz
@given(st.sampled_from(["a.png", "a.tif"]), st.data())
def test_damaged_pictures(tmp_path: Path, name: str, data: st.DataObject) -> None:
    (tmp_path / f"x{name}").write_bytes(data.draw(damaged(picture_content(tmp_path, name), 3000)))
    read_or_refuse(tmp_path / f"x{name}")


@fuzz
@given(
    st.sampled_from([b"", b"LBLSIZE=", b"SIMPLE  =", b"\x35\0CCSD3ZF0", b"II*\0", b"\x89PNG\r\n\x1a\n"]), st.binary()
)
def test_random_bytes(tmp_path: Path, start: bytes, rest: bytes) -> None:
    (tmp_path / "x").write_bytes(start + rest)
    with pytest.raises(RefusedError):
        read_frame(tmp_path / "x")


@pytest.mark.parametrize(
    ("old", "new", "fault"),
    [
        (b"LBLSIZE=800 ", b"LBLSIZE=900000000 ", "claims 900000000 bytes"),
        (b"LBLSIZE=800 ", b"LBLSIZE=190000 ", "truncated"),
        (b"NL=30 ", b"NL=19999 ", "truncated"),
        (b"NL=30 ", b"NL=999999999 ", "more than a camera frame has"),
        (b"NL=30 ", b"NL=-30 ", "non-negative"),
        (b"NS=40 ", b"NS=400 ", "cannot hold"),
        (b"NBB=20 ", b"NBB=-20 ", "non-negative"),
        (b"NLB=1 ", b"NLB=99999999 ", "truncated"),
        (b"NL=30 ", b"NL='30' ", "non-negative integer"),
        (b"NB=1 ", b"NB=3 ", "truncated"),
        (b"FORMAT='BYTE'", b"FORMAT='COMP'", "no plain image"),
    ],
)
def test_sizes_that_lie_are_named(old: bytes, new: bytes, fault: str, tmp_path: Path) -> None:
    assert old in VICAR_LABEL
    content = vicar_content()
    label = content[:800].replace(old, new).rstrip(b"\0").ljust(800, b"\0")
    (tmp_path / "lie.img").write_bytes(label + content[800:])
    with pytest.raises(RefusedError) as refusal:
        read_frame(tmp_path / "lie.img")
    assert fault in refusal.value.fault
    assert "lie.img" in refusal.value.fault


def test_a_fits_file_that_claims_gigabytes_is_refused_before_any_is_allocated(tmp_path: Path) -> None:
    content = fits_content(tmp_path)
    for axis in (b"                   30", b"                   40"):
        assert axis in content
        huge = content.replace(axis, b"           2000000000"[-len(axis) :], 1)
        (tmp_path / "huge.fits").write_bytes(huge)
        with pytest.raises(RefusedError, match="more than a camera frame has"):
            read_frame(tmp_path / "huge.fits")


def test_a_picture_bomb_is_refused_before_it_unfolds(tmp_path: Path) -> None:
    def chunk(kind: bytes, body: bytes) -> bytes:
        return len(body).to_bytes(4, "big") + kind + body + zlib.crc32(kind + body).to_bytes(4, "big")

    for side in (6000, 25000):
        header = side.to_bytes(4, "big") * 2 + bytes([8, 0, 0, 0, 0])
        content = chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(bytes(1000))) + chunk(b"IEND", b"")
        (tmp_path / "bomb.png").write_bytes(b"\x89PNG\r\n\x1a\n" + content)
        with pytest.raises(RefusedError) as refusal:
            read_frame(tmp_path / "bomb.png")
        assert refusal.value.code == "image-too-large"


def test_what_is_no_regular_file_is_refused_without_waiting(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", Path("/dev/zero"), tmp_path, tmp_path / "absent", tmp_path / "a\0b"):
        with pytest.raises(RefusedError):
            read_frame(path)
