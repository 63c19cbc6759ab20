"""Positions as people write them: `219.3,120.7` in pixels, `12.5N,271E` or `-12.5,271` on the body."""

import re
from math import isfinite

from catalog.errors import WrongOptionError

NUMBER = r"[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?"
PIXEL = re.compile(rf"\s*({NUMBER})\s*[,;\s]\s*({NUMBER})\s*")
ANGLE = re.compile(rf"\s*({NUMBER})\s*(?:°|deg)?\s*([NSEWnsew]?)\s*")
HOW_PLACE = "Write latitude and east longitude in degrees: 12.5N,271E or -12.5,271."


def read_pixel(text: str) -> tuple[float, float]:
    """(x, y) of `X,Y`. Raises WrongOptionError for anything else."""
    found = PIXEL.fullmatch(text)
    if not found or not all(isfinite(float(part)) for part in found.groups()):
        remedy = "Write x and y in pixels, 0-based: 219.3,120.7; a place on the body with --place."
        raise WrongOptionError("position", f"{text!r} is no position in an image.", remedy)
    return float(found[1]), float(found[2])


def read_place(text: str) -> tuple[float, float]:
    """(planetocentric latitude, east longitude in [0, 360)), degrees, of `LAT,LON`; letters N, S, E, W say which is
    which and its sign. Raises WrongOptionError for anything else."""
    parts = re.split(r"[,;]|(?<=[\dNSEWnsew.°])\s+(?=[-+.\d])", text.strip())
    matches = [ANGLE.fullmatch(part) for part in parts]
    if len(parts) != 2 or None in matches:
        raise WrongOptionError("place", f"{text!r} is no place.", HOW_PLACE)
    (first, second) = [(float(match[1]), match[2].upper()) for match in matches if match]
    if first[1] in ("E", "W") and (second[1] in ("N", "S") or not second[1]):
        first, second = second, first
    if first[1] in ("E", "W") or second[1] in ("N", "S"):
        raise WrongOptionError("place", f"{text!r} has not one latitude and one longitude.", HOW_PLACE)
    if any(number < 0 and letter for number, letter in (first, second)):
        raise WrongOptionError("place", f"{text!r} has a sign and a letter.", HOW_PLACE)
    latitude, longitude = (-number if letter in ("S", "W") else number for number, letter in (first, second))
    if not abs(latitude) <= 90.0 or not isfinite(longitude):
        raise WrongOptionError("place", f"{text!r}: the latitude {latitude:g} is beyond 90 degrees.", HOW_PLACE)
    return latitude, longitude % 360.0
