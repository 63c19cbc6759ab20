"""Whether a loop stands still although it moves: a correction that is rendered anew at every step goes to and fro.

Rendering and registration have errors of their own, which change with where the pixels' samples fall. A loop cannot
come nearer than these; it then steps across the answer and back for ever. The middle of its way is its answer, and how
far it goes from there is an error that no covariance of a single fit knows.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

# Moves that are looked at together; the longer one sees a slow creep that snaps back.
WINDOWS = (4, 8)
# Below this ratio of late moves to early ones the loop still converges, and is better left to it; above the inverse it
# swings ever farther.
SHRINKS = 0.5
# How far, in pixels, rendering and registration alone keep a loop from its middle. Measured with four registrations on
# disks of 20, 60 and 100 px, image and simulation differing only in sub-pixels: 0.05 px with two sub-pixels a side
# (moves of up to 0.08 px), 0.01 with four, 0.16 with one.
REST_PX = 0.1


@dataclass(frozen=True)
class Rest:
    """back: (k,) from where the loop is to the middle of its way. scatter: (k,) RMS distance from it, per axis; both in
    the unit of the moves."""

    back: Array
    scatter: Array


def rest_of(moves: Sequence[ArrayLike], limit: float) -> Rest | None:
    """Where a loop stands still, or None while it still goes somewhere.

    moves: all its moves so far, (k,) each, in one unit. It stands still when the last of them neither shrink nor grow,
    lead nowhere (their sum is no longer than the longest of them, so that neither a steady drift nor a slow approach
    counts) and keep within `limit` of their middle.
    """
    for count in WINDOWS:
        if len(moves) < count:
            return None
        last = np.asarray(moves[-count:], np.float64)
        length = np.linalg.norm(last, axis=1)
        after = np.cumsum(last, axis=0)
        middle = after.mean(axis=0)
        early, late = length[: count // 2].max(), length[count // 2 :].max()
        alike = SHRINKS * early <= late <= early / SHRINKS
        leads_on = np.linalg.norm(after[-1]) > length.max()
        if alike and not leads_on and np.linalg.norm(after - middle, axis=1).max() <= limit:
            return Rest(middle - after[-1], np.sqrt(np.mean((after - middle) ** 2, axis=0)))
    return None
