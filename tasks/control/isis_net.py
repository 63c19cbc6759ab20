"""ISIS control networks (.net, version 5): a PVL label, a header and the points, as Protocol Buffers messages.

Fields and their numbers are those of ISIS' ControlNetFileHeaderV0005.proto and ControlPointFileEntryV0005.proto, as
USGS' plio has them.
"""

import struct
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from tasks.atomic import file_put_in_place

HEADER_START = 65536
VERSION = 5
FREE, CONSTRAINED = 2, 3
CANDIDATE, REGISTERED_SUB_PIXEL = 0, 3
BUNDLE_SOLUTION, ELLIPSOID = 7, 4
VARINT, DOUBLE, BYTES = 0, 1, 2


@dataclass(frozen=True)
class Measure:
    """sample, line: 1-based, integer at the pixel's centre, as ISIS has them. residual: measured minus computed,
    pixels."""

    serial_number: str
    sample: float
    line: float
    sample_residual: float
    line_residual: float
    sample_sigma: float
    line_sigma: float
    ignored: bool
    rejected: bool


@dataclass(frozen=True)
class Point:
    """a_priori_m, adjusted_m: body-fixed x, y, z in metres; adjusted_covariance: upper triangle, m^2. reference: number
    of the measure that the others were matched with."""

    identifier: str
    a_priori_m: Sequence[float]
    adjusted_m: Sequence[float]
    adjusted_covariance: Sequence[float]
    reference: int
    ignored: bool
    measures: Sequence[Measure]


def write_isis_net(path: Path, network: str, target: str, when: str, user: str, points: Sequence[Point]) -> Path:
    """Write a control network and return `path`. when: `YYYY-MM-DDThh:mm:ss`."""
    description = "Tie points between images, adjusted by planetpose"
    texts = (network, target, when, when, description, user)
    header = b"".join(_text(number, text) for number, text in enumerate(texts, start=1))
    header += _number(7, len(points))
    body = b"".join(struct.pack("<i", len(message)) + message for message in map(_point_message, points))
    measures = sum(len(point.measures) for point in points)
    label = _label(len(header), len(body), texts, len(points), measures)
    with file_put_in_place(path) as temporary:
        temporary.write_bytes(label.ljust(HEADER_START, b"\0") + header + body)
    return path


def _label(header_bytes: int, points_bytes: int, texts: Sequence[str], points: int, measures: int) -> bytes:
    network, target, created, modified, description, user = texts
    return (
        "Object = ProtoBuffer\n  Object = Core\n"
        f"    HeaderStartByte = {HEADER_START}\n    HeaderBytes     = {header_bytes}\n"
        f"    PointsStartByte = {HEADER_START + header_bytes}\n    PointsBytes     = {points_bytes}\n  End_Object\n\n"
        "  Group = ControlNetworkInfo\n"
        f'    NetworkId        = "{network}"\n    TargetName       = "{target}"\n    UserName         = "{user}"\n'
        f'    Created          = {created}\n    LastModified     = {modified}\n    Description      = "{description}"\n'
        f"    NumberOfPoints   = {points}\n    NumberOfMeasures = {measures}\n    Version          = {VERSION}\n"
        "  End_Group\nEnd_Object\nEnd\n"
    ).encode("ascii", "replace")


def _point_message(point: Point) -> bytes:
    parts = [_text(1, point.identifier), _number(2, FREE), _text(3, "planetpose"), _flag(6, point.ignored)]
    parts += [_number(8, point.reference), _number(9, ELLIPSOID), _number(11, ELLIPSOID)]
    parts += [_double(16 + k, value) for k, value in enumerate(point.a_priori_m)]
    parts += [_double(20 + k, value) for k, value in enumerate(point.adjusted_m)]
    parts.append(_packed(23, point.adjusted_covariance))
    parts += [_message(25, _measure_message(measure)) for measure in point.measures]
    return b"".join(parts)


def _measure_message(measure: Measure) -> bytes:
    doubles = (measure.sample, measure.line, measure.sample_residual, measure.line_residual)
    parts = [_text(1, measure.serial_number), _number(2, REGISTERED_SUB_PIXEL)]
    parts += [_double(3 + k, value) for k, value in enumerate(doubles)]
    parts += [_text(7, "planetpose"), _flag(10, measure.ignored), _flag(11, measure.rejected)]
    parts += [_double(15, measure.sample_sigma), _double(16, measure.line_sigma)]
    return b"".join(parts)


def _varint(value: int) -> bytes:
    found = bytearray()
    while value > 0x7F:
        found.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*found, value])


def _key(number: int, kind: int) -> bytes:
    return _varint(number << 3 | kind)


def _number(number: int, value: int) -> bytes:
    return _key(number, VARINT) + _varint(value)


def _flag(number: int, value: bool) -> bytes:
    return _number(number, int(value))


def _double(number: int, value: float) -> bytes:
    return _key(number, DOUBLE) + struct.pack("<d", value)


def _message(number: int, content: bytes) -> bytes:
    return _key(number, BYTES) + _varint(len(content)) + content


def _text(number: int, text: str) -> bytes:
    return _message(number, text.encode("utf-8"))


def _packed(number: int, values: Iterable[float]) -> bytes:
    return _message(number, b"".join(struct.pack("<d", value) for value in values))
