"""Pixels that never arrived: zero-filled lines, columns and stretches of lines in raw frames."""

import numpy as np
from numpy.typing import NDArray

MIN_ZERO_RUN_PX = 8  # longer than a reseau mark is wide


def zero_filled(image: NDArray) -> NDArray[np.bool_]:
    """Mask (ny, nx) of runs of at least `MIN_ZERO_RUN_PX` zeros along a line of raw data numbers.

    A detector's dark level lies above zero, so such a run is filling, not sky. Frames whose zeros are mostly scattered
    (dark level at zero) get no mask but for whole lines.
    """
    zero = image == 0
    runs = _long_runs(zero)
    scattered = int(zero.sum() - runs.sum())
    if scattered > 0.02 * zero.size:
        return np.broadcast_to(zero.all(axis=1, keepdims=True), zero.shape).copy()
    return runs


def _long_runs(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The parts of `mask` that belong to horizontal runs of at least MIN_ZERO_RUN_PX."""
    padded = np.pad(mask, ((0, 0), (1, 1))).astype(np.int8)
    steps = np.diff(padded, axis=1)
    lines, starts = np.nonzero(steps == 1)
    _, ends = np.nonzero(steps == -1)
    long = ends - starts >= min(MIN_ZERO_RUN_PX, mask.shape[1])
    marks = np.zeros((mask.shape[0], mask.shape[1] + 1), np.int32)
    np.add.at(marks, (lines[long], starts[long]), 1)
    np.add.at(marks, (lines[long], ends[long]), -1)
    return np.cumsum(marks, axis=1)[:, :-1] > 0


def border_zeros(image: NDArray) -> NDArray[np.bool_]:
    """Mask (ny, nx) of zeros that reach the frame's border along their line or column without a gap: what a geometric
    correction could not fill."""
    zero = image == 0
    from_left, from_top = (np.logical_and.accumulate(zero, axis=axis) for axis in (1, 0))
    from_right = np.logical_and.accumulate(zero[:, ::-1], axis=1)[:, ::-1]
    from_bottom = np.logical_and.accumulate(zero[::-1], axis=0)[::-1]
    return from_left | from_right | from_top | from_bottom
