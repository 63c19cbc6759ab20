"""The ways in which a picture may have been mirrored or turned by quarters, and how to undo them."""

import math
from collections.abc import Mapping
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

Flip = Literal["x", "y", "rot90", "rot180", "rot270", "transpose", "antitranspose"]

# Where a flip takes a place (x, y), y down, about the middle: as a matrix. rot90: clockwise, as seen.
PLACES: dict[Flip, NDArray[np.float64]] = {
    "x": np.array([[-1.0, 0.0], [0.0, 1.0]]),
    "y": np.array([[1.0, 0.0], [0.0, -1.0]]),
    "rot90": np.array([[0.0, -1.0], [1.0, 0.0]]),
    "rot180": np.array([[-1.0, 0.0], [0.0, -1.0]]),
    "rot270": np.array([[0.0, 1.0], [-1.0, 0.0]]),
    "transpose": np.array([[0.0, 1.0], [1.0, 0.0]]),
    "antitranspose": np.array([[0.0, -1.0], [-1.0, 0.0]]),
}
MEANINGS: dict[Flip, str] = {
    "x": "mirrored left to right",
    "y": "mirrored top to bottom",
    "rot90": "turned by 90 deg, clockwise",
    "rot180": "turned by 180 deg",
    "rot270": "turned by 90 deg, anticlockwise",
    "transpose": "mirrored about the diagonal from its first pixel",
    "antitranspose": "mirrored about the diagonal to its first line's end",
}


def flipped(plane: NDArray[Any], flip: Flip) -> NDArray[Any]:
    """A picture (ny, nx) flipped as a whole; quarter turns and diagonals exchange its sides."""
    turned = {
        "x": lambda a: a[:, ::-1],
        "y": lambda a: a[::-1],
        "rot90": lambda a: np.rot90(a, -1),
        "rot180": lambda a: a[::-1, ::-1],
        "rot270": lambda a: np.rot90(a, 1),
        "transpose": lambda a: a.T,
        "antitranspose": lambda a: a[::-1, ::-1].T,
    }
    return np.ascontiguousarray(turned[flip](plane))


def geometry_as_flipped(geometry: Mapping[str, float], flip: Flip, shape: tuple[int, int]) -> dict[str, float]:
    """A label's scalars of a picture (`catalog.label_geometry`), which count and turn as the file has its lines, for
    the flipped picture. shape: (ny, nx) before."""
    found, turn = dict(geometry), PLACES[flip]
    middle = (np.array(shape[::-1], dtype=np.float64) - 1) / 2
    if "centre_x_px" in found and "centre_y_px" in found:
        after = middle[::-1] if turn[0, 0] == 0 else middle
        place = turn @ (np.array([found["centre_x_px"], found["centre_y_px"]]) - middle) + after
        found["centre_x_px"], found["centre_y_px"] = (float(value) for value in place)
    if "north_azimuth_deg" in found:  # clockwise from the direction of growing x
        azimuth = math.radians(found["north_azimuth_deg"])
        x, y = turn @ (math.cos(azimuth), math.sin(azimuth))
        found["north_azimuth_deg"] = math.degrees(math.atan2(y, x)) % 360.0
    return found
