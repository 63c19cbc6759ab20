"""Compressed Voyager images: coding round trip, and files cut or altered."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from catalog.errors import RefusedError
from catalog.observation import Quality
from catalog.readers import read_frame
from catalog.readers.huffman import ZERO_DIFFERENCE, code_tree, decode_lines
from catalog.times import et_from_utc


def difference_histogram(image: NDArray[np.uint8]) -> NDArray[np.int64]:
    steps = np.diff(image.astype(int), axis=1)
    return np.bincount((ZERO_DIFFERENCE - steps).ravel(), minlength=511)


def codes(children: NDArray[np.int32], symbols: NDArray[np.int32]) -> dict[int, str]:
    found, waiting = {}, [(0, "")]
    while waiting:
        node, bits = waiting.pop()
        if symbols[node] >= 0:
            found[int(symbols[node])] = bits
        else:
            waiting += [(int(children[node, bit]), f"{bits}{bit}") for bit in (0, 1)]
    return found


def encoded(image: NDArray[np.uint8]) -> list[bytes]:
    table = codes(*code_tree(difference_histogram(image)))
    lines = []
    for row in image.astype(int):
        bits = "".join(table[ZERO_DIFFERENCE - step] for step in np.diff(row))
        padded = bits.ljust(-(-len(bits) // 8) * 8, "0")
        lines.append(bytes([row[0]]) + bytes(int(padded[i : i + 8], 2) for i in range(0, len(padded), 8)))
    return lines


def imq_file(path: Path, image: NDArray[np.uint8], label_extra: str = "") -> Path:
    label = [
        "CCSD3ZF0000100000001NJPL3IF0PDS200000001 = SFDU_LABEL",
        "^IMAGE_HISTOGRAM = 14",
        "^ENCODING_HISTOGRAM = 15",
        "^IMAGE = 18",
        "SPACECRAFT_NAME = VOYAGER_1",
        "INSTRUMENT_NAME = WIDE_ANGLE_CAMERA",
        "TARGET_NAME = ENCELADU",
        "IMAGE_TIME = 1980-11-12T02:35:11Z",
        "FILTER_NAME = CLEAR",
        "EXPOSURE_DURATION = 0.1200 <SECONDS>",
        f"NOTE = 'X' {label_extra}",
        "/* COMMENT */",
        "END",
    ]
    histogram = difference_histogram(image).astype("<u4").tobytes()
    records = [line.encode() for line in label]
    records += [np.bincount(image.ravel(), minlength=256).astype("<u4").tobytes()]
    records += [histogram[:836], histogram[836:1672], histogram[1672:], *encoded(image)]
    path.write_bytes(b"".join(len(r).to_bytes(2, "little") + r + b"\0" * (len(r) % 2) for r in records))
    return path


@pytest.fixture(scope="module")
def image() -> NDArray[np.uint8]:
    rng = np.random.default_rng(8)
    smooth = 60 + 40 * np.sin(np.arange(800) / 90)[None, :] * np.cos(np.arange(800) / 70)[:, None]
    return (smooth + rng.normal(0, 1.5, (800, 800))).astype(np.uint8)


@given(st.lists(st.integers(0, 255), min_size=2, max_size=60), st.integers(2, 5), st.integers(0, 10))
def test_any_lines_survive_the_coding(values: list[int], lines: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    picture = np.array([rng.permutation(values) for _ in range(lines)], np.uint8)
    if np.count_nonzero(difference_histogram(picture)) < 2:
        return
    tree = code_tree(difference_histogram(picture))
    decoded, filled = decode_lines(encoded(picture), picture.shape[1], *tree)
    assert np.array_equal(decoded, picture)
    assert (filled == picture.shape[1]).all()


def test_equal_frequencies_follow_the_archives_rule() -> None:
    histogram = np.zeros(511, np.int64)
    histogram[[10, 20, 30, 40]] = 1, 1, 2, 2
    # 10 and 20 join to a node of frequency 2, which goes before 30 and 40 and is joined with 30 first
    assert codes(*code_tree(histogram)) == {40: "0", 10: "100", 20: "101", 30: "11"}


def test_a_file_gives_image_time_and_camera(image: NDArray[np.uint8], tmp_path: Path) -> None:
    frame = read_frame(imq_file(tmp_path / "c1.imq", image))
    assert np.array_equal(frame.observation.image, image.astype(np.float32))
    assert (frame.camera, frame.target, frame.exposure_s, frame.filter) == ("voyager1-wac", "enceladus", 0.12, "CLEAR")
    assert frame.et == pytest.approx(et_from_utc("1980-11-12T02:35:08.940"), abs=1e-6)
    assert not frame.observation.quality.any()


def test_a_line_that_ends_early_is_missing_from_there_on(image: NDArray[np.uint8], tmp_path: Path) -> None:
    content = imq_file(tmp_path / "c1.imq", image).read_bytes()
    last_line = encoded(image)[-1]
    start = content.rindex(last_line)
    short = last_line[: len(last_line) // 2]
    (tmp_path / "c1.imq").write_bytes(content[: start - 2] + len(short).to_bytes(2, "little") + short)
    quality = read_frame(tmp_path / "c1.imq").observation.quality
    assert quality[799, 799] == Quality.MISSING
    assert quality[799, 0] == 0
    assert not quality[:799].any()


def test_damage_is_refused_by_name(image: NDArray[np.uint8], tmp_path: Path) -> None:
    content = imq_file(tmp_path / "c1.imq", image).read_bytes()
    middle = difference_histogram(image).astype("<u4").tobytes()[836:1672]
    assert middle in content
    faults = {
        "truncated": content[: len(content) // 2],
        "no END": content.replace(b"\x03\0END", b"\x03\0ENX"),
        "^IMAGE_HISTOGRAM = 9999": content.replace(b"^IMAGE_HISTOGRAM = 14", b"^IMAGE_HISTOGRAM=9999"),
        "disagree with the histogram": content.replace(middle, middle[4:] + middle[:4]),
    }
    for fault, damaged in faults.items():
        (tmp_path / "bad.imq").write_bytes(damaged)
        with pytest.raises(RefusedError) as refusal:
            read_frame(tmp_path / "bad.imq")
        assert "bad.imq" in refusal.value.fault
        assert fault in refusal.value.fault
