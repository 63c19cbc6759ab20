"""Lines of sight and the ellipsoid, in coordinates where the ellipsoid is the unit sphere (see `tasks.project.rays`).

Paper, equations 13-16, solved from the point of closest approach to the centre: that keeps the root accurate at the
limb, and no large numbers cancel where the anchor of the line lies near the target.
"""

import math

import numpy as np
from numpy.typing import NDArray

from tasks.compiled import compiled

Array = NDArray[np.float64]


@compiled
def closest_approach(ax, ay, az, bx, by, bz):  # type: ignore[no-untyped-def]
    """Of the line a + w b to the centre: the closest point, the square of half the chord that the sphere cuts out of
    the line (negative where it misses), and b . b."""
    length2 = bx * bx + by * by + bz * bz
    w = -(ax * bx + ay * by + az * bz) / length2
    cx, cy, cz = ax + w * bx, ay + w * by, az + w * bz
    return cx, cy, cz, 1.0 - (cx * cx + cy * cy + cz * cz), length2


@compiled
def first_hit(ax, ay, az, bx, by, bz, sx, sy, sz):  # type: ignore[no-untyped-def]
    """Where the line a + w b, whose b points back to its start s, first meets the sphere; NaN where it does not."""
    cx, cy, cz, half_chord2, length2 = closest_approach(ax, ay, az, bx, by, bz)
    w = math.sqrt(half_chord2 / length2)
    cx, cy, cz = cx + w * bx, cy + w * by, cz + w * bz
    ahead = (sx - cx) * bx + (sy - cy) * by + (sz - cz) * bz > 0.0
    return (cx if ahead else np.nan), (cy if ahead else np.nan), (cz if ahead else np.nan)


def first_hits(anchor: Array, backward: Array, start: Array) -> Array:
    """The same for lines (n, 3), (n, 3) from one start (3,): points (n, 3)."""
    out = np.empty(anchor.shape)
    _first_hits(np.ascontiguousarray(anchor), np.ascontiguousarray(backward), start, out)
    return out


@compiled
def _first_hits(anchor, backward, start, out):  # type: ignore[no-untyped-def]
    for i in range(len(out)):
        out[i, 0], out[i, 1], out[i, 2] = first_hit(
            anchor[i, 0],
            anchor[i, 1],
            anchor[i, 2],
            backward[i, 0],
            backward[i, 1],
            backward[i, 2],
            start[0],
            start[1],
            start[2],
        )
