"""Binary kernels: orientation of camera and scan platform (CK), of the target (PCK), trajectories (SPK).

SPICE's DAF files are opened, filled, commented and closed; to be called inside `catalog.spice.kernel_pool`.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tasks.kernels.windows import Window

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
LONGEST_SEGMENT_NAME = 40


@dataclass(frozen=True)
class Orientation:
    """A frame's constant orientation: `frame_from_j2000` (3, 3) within window (TDB)."""

    name: str
    window: Window
    frame_from_j2000: Matrix


@dataclass(frozen=True)
class Spin:
    """A body's attitude: body_from_j2000 (3, 3) at `et`, turning about its pole at rate_deg_per_s, within window."""

    name: str
    window: Window
    et: float
    body_from_j2000: Matrix
    rate_deg_per_s: float


@dataclass(frozen=True)
class Motion:
    """Straight motion of `body` relative to `centre`: position (3,) km at `et`, velocity (3,) km/s, within window."""

    name: str
    window: Window
    body: int
    centre: int
    et: float
    position_km: Vector
    velocity_km_s: Vector

    def at(self, et: float) -> Vector:
        """State (6,) at `et`."""
        return np.concatenate([self.position_km + self.velocity_km_s * (et - self.et), self.velocity_km_s])


@contextmanager
def _daf(path: Path, open_new: Callable, close: Callable, comment: Sequence[str]) -> Iterator[int]:
    import spiceypy

    handle = open_new(str(path), "planetpose", 0)
    spiceypy.dafac(handle, [line or " " for line in comment])
    finish = spiceypy.dafcls  # a file left half-done is just closed: SPICE would refuse it and hide the reason
    try:
        yield handle
        finish = close
    finally:
        finish(handle)


def _segment_name(name: str) -> str:
    return name.encode("ascii", "replace").decode()[:LONGEST_SEGMENT_NAME]


def write_ck(
    path: Path, clocks: dict[int, int], orientations: dict[int, list[Orientation]], comment: list[str]
) -> None:
    """CK of type 3 by structure, one segment per exposure: a constant orientation relative to J2000, at rest.

    clocks: the SCLK of each structure; both must be loaded.
    """
    import spiceypy

    with _daf(path, spiceypy.ckopn, spiceypy.ckcls, comment) as handle:
        for structure, of_structure in orientations.items():
            for o in of_structure:
                ticks = [spiceypy.sce2c(clocks[structure], et) for et in o.window]
                quaternions, rates = np.tile(spiceypy.m2q(np.array(o.frame_from_j2000)), (2, 1)), np.zeros((2, 3))
                name = _segment_name(o.name)
                spiceypy.ckw03(
                    handle, *ticks, structure, "J2000", True, name, 2, ticks, quaternions, rates, 1, ticks[:1]
                )


def write_pck(path: Path, spins: dict[int, list[Spin]], comment: list[str]) -> None:
    """Binary PCK of type 2 by PCK frame class: right ascension + 90, 90 - declination and meridian, linear in time."""
    import spiceypy

    with _daf(path, spiceypy.pckopn, spiceypy.pckcls, comment) as handle:
        for class_id, of_body in spins.items():
            for s in of_body:
                meridian, tilt, node = spiceypy.m2eul(np.array(s.body_from_j2000), 3, 1, 3)
                first, last = s.window
                middle, half = (first + last) / 2, (last - first) / 2
                rate = np.radians(s.rate_deg_per_s)
                angles = [node, 0.0, tilt, 0.0, meridian + rate * (middle - s.et), rate * half]
                spiceypy.pckw02(
                    handle, class_id, "J2000", first, last, _segment_name(s.name), 2 * half, 1, 1, angles, first
                )


def write_spk(path: Path, motions: Iterable[Motion], comment: list[str]) -> None:
    """SPK of type 13 (Hermite), one segment per motion."""
    import spiceypy

    with _daf(path, spiceypy.spkopn, spiceypy.spkcls, comment) as handle:
        for m in motions:
            first, last = m.window
            times = np.array([first, (first + last) / 2, last])
            states = np.array([m.at(t) for t in times])
            spiceypy.spkw13(
                handle, m.body, m.centre, "J2000", first, last, _segment_name(m.name), 3, len(times), states, times
            )
