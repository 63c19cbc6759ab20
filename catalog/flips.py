"""The ways in which a picture may have been mirrored or turned by quarters, and how to undo them."""

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
