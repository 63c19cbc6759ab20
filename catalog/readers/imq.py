"""Reader of the compressed Voyager images (.imq) of the PDS CD-ROMs: records of VAX/VMS with their length in front."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.observation import Quality
from catalog.readers.exposure_time import claim, exposure_time
from catalog.readers.gaps import zero_filled
from catalog.readers.huffman import DIFFERENCES, code_tree, decode_lines
from catalog.readers.label_values import number, plain_label, text
from catalog.readers.names import instrument_names, targets_of_label
from catalog.readers.pds3_label import parse_label
from catalog.readers.reading import Reading, unreadable
from catalog.regular_file import read_regular

MAX_FILE_BYTES = 10_000_000
MAX_RECORDS = 10_000
MAX_LABEL_RECORDS = 500
MAX_LINE_BYTES = 2048
FRAME = (800, 800)
READOUT_DELAY_S = 2.0
MAX_HISTOGRAM_MISMATCH = 0.01


class ImqReader:
    """Voyager images with Huffman-coded first differences and a PDS label in front."""

    def recognises(self, head: bytes, path: Path) -> bool:  # noqa: ARG002
        """The first record, behind its 16-bit length, is an SFDU or PDS label."""
        length = int.from_bytes(head[:2], "little")
        return 0 < length < 256 and (head[2:10] == b"CCSD3ZF0" or (head[2:7] == b"NJPL1"))

    def read(self, path: Path, plane: str | None = None) -> Reading:  # noqa: ARG002
        """Pixels, checked against the histogram that the file carries, and the label's metadata."""
        records = _records(path)
        label = _label(path, records)
        image, missing = _image(path, label, records)
        exposure_s = number(label, "EXPOSURE_DURATION")
        readout = claim("IMAGE_TIME", text(label, "IMAGE_TIME"), "end", later_s=-READOUT_DELAY_S)
        return Reading(
            format="voyager-imq",
            image=image,
            quality=np.where(missing | zero_filled(image), Quality.MISSING, 0).astype(np.uint16),
            instrument_names=instrument_names(label),
            targets=targets_of_label(label.get("TARGET_NAME")),
            time=exposure_time(readout, {"EXPOSURE_DURATION": exposure_s}),
            exposure_s=exposure_s,
            filter=text(label, "FILTER_NAME"),
            raw_dn=True,
            undistorted=False,
            gain=text(label, "GAIN_MODE_ID"),
            sources={"camera": "INSTRUMENT_NAME", "target": "TARGET_NAME", "exposure_s": "EXPOSURE_DURATION"},
            label=plain_label(label),
        )


def _records(path: Path) -> list[bytes]:
    size = path.stat().st_size
    if size > MAX_FILE_BYTES:
        raise unreadable(path, f"{size} bytes are too many for a compressed Voyager image")
    content = read_regular(path, MAX_FILE_BYTES)
    records: list[bytes] = []
    offset = 0
    while offset + 2 <= size:
        length = int.from_bytes(content[offset : offset + 2], "little")
        if len(records) >= MAX_RECORDS:
            raise unreadable(path, f"it has more than {MAX_RECORDS} records")
        if offset + 2 + length > size:
            raise unreadable(path, f"truncated: the record at byte {offset} claims {length} bytes")
        records.append(content[offset + 2 : offset + 2 + length])
        offset += 2 + length + length % 2
    return records


def _label(path: Path, records: list[bytes]) -> dict[str, Any]:
    end = next((i for i, record in enumerate(records[:MAX_LABEL_RECORDS]) if record.strip() == b"END"), None)
    if end is None:
        raise unreadable(path, "its PDS label has no END")
    try:
        return parse_label("\r\n".join(record.decode("latin-1") for record in records[: end + 1]))
    except ValueError as error:
        raise unreadable(path, str(error)) from error


def _first_record(path: Path, label: dict[str, Any], pointer: str, records: list[bytes]) -> int:
    position = label.get(pointer)
    if not isinstance(position, int) or not 1 <= position <= len(records):
        raise unreadable(path, f"its label gives {pointer} = {position!r}, the file has {len(records)} records")
    return position - 1


def _histogram(path: Path, label: dict[str, Any], pointer: str, records: list[bytes], items: int) -> NDArray[np.int64]:
    start = _first_record(path, label, pointer, records)
    content = b"".join(records[start : start + 4])
    if len(content) < 4 * items:
        raise unreadable(path, f"its {pointer} is cut off")
    return np.frombuffer(content[: 4 * items], "<u4").astype(np.int64)


def _image(path: Path, label: dict[str, Any], records: list[bytes]) -> tuple[NDArray[np.uint8], NDArray[np.bool_]]:
    """Pixels (800, 800) and the mask of those that a line's bytes did not hold."""
    lines, samples = FRAME
    start = _first_record(path, label, "^IMAGE", records)
    coded = records[start : start + lines]
    if len(coded) < lines:
        raise unreadable(path, f"truncated: it has {len(coded)} of {lines} lines")
    if max(map(len, coded)) > MAX_LINE_BYTES:
        raise unreadable(path, f"one of its coded lines has {max(map(len, coded))} bytes")
    try:
        tree = code_tree(_histogram(path, label, "^ENCODING_HISTOGRAM", records, DIFFERENCES))
    except ValueError as error:
        raise unreadable(path, str(error)) from error
    image, filled = decode_lines(coded, samples, *tree)
    expected = _histogram(path, label, "^IMAGE_HISTOGRAM", records, 256)
    mismatch = np.abs(np.bincount(image.ravel(), minlength=256) - expected).sum() / 2 / image.size
    if mismatch > MAX_HISTOGRAM_MISMATCH:
        raise unreadable(path, f"{mismatch:.0%} of its decoded pixels disagree with the histogram in the file")
    return image, np.arange(samples) >= filled[:, None]
