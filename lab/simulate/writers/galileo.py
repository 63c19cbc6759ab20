"""Galileo SSI REDR: VICAR with 200 bytes before each line and the keywords that `catalog.readers.galileo` reads."""

import re
from pathlib import Path

from catalog.times import utc_from_et
from lab.simulate.writers.raw_image import RawImage
from lab.simulate.writers.vicar_file import PLAIN, write_vicar_bytes

PREFIX_BYTES = 200
GREEN = 1
UNKNOWN = -999.0
GEOMETRY = (
    "TARGET_CENTER_DISTANCE",
    "SUB_SPACECRAFT_LATITUDE",
    "SUB_SPACECRAFT_LONGITUDE",
    "SUB_SPACECRAFT_LINE",
    "SUB_SPACECRAFT_SAMPLE",
    "NORAZ",
)


def write_galileo(raw: RawImage, path: Path) -> None:
    """Write a whole frame. Its label says of the geometry only that it is unknown: the pose file has it."""
    from astropy.time import Time

    time = Time(utc_from_et(raw.pose.et).removesuffix("Z"), scale="utc", precision=3)
    year, day, hour, minute, second, millisecond = map(int, re.split(r"[:.]", time.yday))
    lines, samples = raw.image.shape
    keywords: dict[str, PLAIN] = {
        "MISSION": "GALILEO",
        "SENSOR": "SSI",
        "PICNO": raw.product,
        "TARGET": raw.target.upper(),
        "SCETYEAR": year,
        "SCETDAY": day,
        "SCETHOUR": hour,
        "SCETMIN": minute,
        "SCETSEC": second,
        "SCETMSEC": millisecond,
        "FILTER": GREEN,
        "EXP": round(1000 * raw.exposure_s, 4),
        "GAIN": 2,
        "CUT_OUT_WINDOW": (1, 1, lines, samples),
        **dict.fromkeys(GEOMETRY, UNKNOWN),
        "TASK": "SIMULATE",
        "USER": "PLANETPOSE",
    }
    write_vicar_bytes(path, raw.image, keywords, PREFIX_BYTES)
