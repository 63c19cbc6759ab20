"""Filling in a noisy image: whole lines or columns, stretches of lines and rectangles of one and the same value.

Noise makes no run of equal numbers. Where a run has noise right above and below it, over its whole length, its pixels
never arrived. A sky that is exactly zero, as simulated and some calibrated images have, has no noise beside it: there
the disk begins somewhere in a line, not over all of it.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

MIN_RUN_PX = 16
MIN_WIDTH_PX = 32
MAX_SEGMENTS, MIN_SEGMENT_PX = 8, 8
"""A line beside a run is looked at in up to 8 segments; 7 of 8 have to be noisy. A limb that enters a frame of 512
pixels over 7 of 8 segments in one line belongs to a disk of more than 25 000 px radius."""
NOISY_SHARE = 0.2
"""Of neighbouring pixels that differ: 0 in a sky of one value, 0.3 with noise of 0.3 data numbers, 1 in floats."""
MAX_LOG_CHANCE = -25.0
"""Natural logarithm of the chance that pixels with the neighbours' share of that value make such a run: 1e-11."""
WINDOW_EDGE_SHARE = 0.05  # of pixels along a window's edge that have the value outside, as dark noise may
MAX_VALUES = 3  # besides zero and the smallest number
SIDE_LINES = 3  # a stretch that touches the frame's top or bottom has noise on one side only: it must be this high


@dataclass(frozen=True)
class Filling:
    """mask: (ny, nx) of filled pixels. values: of the filling, most frequent first."""

    mask: NDArray[np.bool_]
    values: tuple[float, ...] = ()

    @property
    def sentences(self) -> tuple[str, ...]:
        """A sentence for people, none where nothing is filled."""
        count = int(np.count_nonzero(self.mask))
        if not count:
            return ()
        lines, columns = (int(self.mask.any(axis=axis).sum()) for axis in (1, 0))
        named = ", ".join(f"{value:g}" for value in self.values[:3])
        return (
            f"{count} pixels ({count / self.mask.size:.1%}, in {lines} lines and {columns} columns) are taken for "
            f"missing: they all have the value {named} while those beside them are noisy",
        )


@dataclass(frozen=True)
class _Run:
    """Lines top .. bottom - 1, columns left .. right - 1, all of one value."""

    top: int
    bottom: int
    left: int
    right: int
    value: float


def filled(image: NDArray, known: NDArray[np.bool_] | None = None) -> Filling:
    """Pixels (ny, nx) that are filling. known: pixels that are missing anyway."""
    mask = np.zeros(image.shape, bool)
    if min(image.shape) < MIN_WIDTH_PX or image.dtype.kind not in "iuf":
        return Filling(mask)
    values: dict[float, int] = {}
    window = _window(image)
    if window is not None:
        mask[:] = True
        mask[window] = False
        outside = float(image[mask][0])
        values[outside] = int(np.count_nonzero(mask))
        inside = filled(image[window])
        mask[window] |= inside.mask
        if known is not None:
            mask &= ~known
        return Filling(mask, tuple(dict.fromkeys((outside, *inside.values))))
    for picture, marks in ((image, mask), (image.T, mask.T)):
        for run in [*_whole_lines(picture), *(_stretches(picture) if picture is image else ())]:
            region = marks[run.top : run.bottom, run.left : run.right]
            values[run.value] = values.get(run.value, 0) + int(np.count_nonzero(~region))
            region[:] = True
    if known is not None:
        mask &= ~known
    return Filling(mask, tuple(sorted(values, key=lambda value: -values[value])))


def _window(image: NDArray) -> tuple[slice, slice] | None:
    """The rectangle outside which all pixels have one value, where it is a window of an image: along all its edges that
    are not the frame's hardly a pixel has that value, and one of them at least is noisy. None where there is no such
    rectangle, or it is the frame.

    The rectangle around a disk in a sky of one value touches the disk with a few pixels of each edge only; a limb that
    enters a frame of 800 pixels over 95 % of one line belongs to a disk of more than 70 000 px radius."""
    corners = {image[y, x] for y in (0, -1) for x in (0, -1)}
    for value in corners:
        other = image != value
        lines, columns = (np.flatnonzero(other.any(axis=axis)) for axis in (1, 0))
        if not lines.size:
            continue
        top, bottom, left, right = int(lines[0]), int(lines[-1]) + 1, int(columns[0]), int(columns[-1]) + 1
        if (bottom - top, right - left) == image.shape or min(bottom - top, right - left) < MIN_WIDTH_PX:
            continue
        inner = image[top:bottom, left:right]
        edges = [
            edge
            for at_frame, edge in (
                (top == 0, inner[0]),
                (bottom == len(image), inner[-1]),
                (left == 0, inner[:, 0]),
                (right == image.shape[1], inner[:, -1]),
            )
            if not at_frame
        ]
        is_noisy = any(_is_noisy(edge, _Run(0, 1, 0, edge.size, float(value))) for edge in edges)
        if is_noisy and all(float(np.mean(edge == value)) <= WINDOW_EDGE_SHARE for edge in edges):
            return slice(top, bottom), slice(left, right)
    return None


def _whole_lines(image: NDArray) -> list[_Run]:
    """Blocks of constant lines with noise above or below."""
    constant = (image == image[:, :1]).all(axis=1)
    runs = []
    for top in np.flatnonzero(constant):
        value = image[top, 0]
        if top and constant[top - 1] and image[top - 1, 0] == value:
            continue
        bottom = top + 1
        while bottom < len(image) and constant[bottom] and image[bottom, 0] == value:
            bottom += 1
        run = _Run(int(top), int(bottom), 0, image.shape[1], float(value))
        nearest = [*np.flatnonzero(~constant[:top])[-1:], *(bottom + np.flatnonzero(~constant[bottom:])[:1])]
        if any(_is_noisy(image[line], run) for line in nearest):  # beyond blocks of another value
            runs.append(run)
    return runs


def _stretches(image: NDArray) -> list[_Run]:
    """Runs of a value that filling has, of equal columns in one or more lines, with noise above and below."""
    found: list[_Run] = []
    at_edges: list[_Run] = []
    for value in _values_of_filling(image):
        lines, starts, ends = _runs(image == value)
        whole = (starts == 0) & (ends == image.shape[1])
        for at_edge in (ends == image.shape[1], starts == 0):
            at_edges += _groups_at_edge(image, lines[at_edge], starts[at_edge], ends[at_edge], value)
        open_runs: dict[tuple[int, int], _Run] = {}
        for line, left, right in zip(lines[~whole], starts[~whole], ends[~whole], strict=True):
            run = open_runs.get((left, right))
            if run is not None and run.bottom == line:
                open_runs[left, right] = _Run(run.top, int(line) + 1, run.left, run.right, value)
                continue
            if run is not None:
                found.append(run)
            open_runs[left, right] = _Run(int(line), int(line) + 1, int(left), int(right), value)
        found += open_runs.values()
    return [*at_edges, *(run for run in found if _is_filled(image, run))]


def _groups_at_edge(
    image: NDArray, lines: NDArray[np.intp], starts: NDArray[np.intp], ends: NDArray[np.intp], value: float
) -> list[_Run]:
    """Stretches of one to many lines below each other that all reach the same edge, beginning where they like, with
    noise above the first and below the last. (The sky beside one round body goes on to the frame's top or bottom.)"""
    found: list[_Run] = []
    for group in np.split(np.arange(len(lines)), np.flatnonzero(np.diff(lines) != 1) + 1):
        if not len(group):
            continue
        runs = [_Run(int(lines[i]), int(lines[i]) + 1, int(starts[i]), int(ends[i]), value) for i in group]
        first, last = runs[0], runs[-1]
        if first.top == 0 or last.bottom == len(image):
            continue
        above, below = image[first.top - 1, first.left : first.right], image[last.bottom, last.left : last.right]
        if _is_noisy(above, first) and _is_noisy(below, last):
            found += runs
    return found


def _is_filled(image: NDArray, run: _Run) -> bool:
    sides = _sides(image, run)
    if len(sides) < 2 and run.bottom - run.top < SIDE_LINES:
        return False
    return bool(sides) and all(_is_noisy(side, run) for side in sides)


def _values_of_filling(image: NDArray) -> list[float]:
    """Zero, the smallest number, and those that most runs have; runs of whole numbers' largest one are saturation."""
    finite = image[np.isfinite(image)] if image.dtype.kind == "f" else image
    if not finite.size:
        return []
    lines, starts, ends = _runs(np.pad(image[:, 1:] == image[:, :-1], ((0, 0), (0, 1))))
    values, which = np.unique(image[lines, starts], return_inverse=True)
    order = np.argsort(-np.bincount(which, ends - starts, minlength=len(values)), kind="stable")
    frequent = [float(value) for value in values[order[:MAX_VALUES]] if np.isfinite(value)]
    saturated = float(finite.max()) if image.dtype.kind in "iu" else None
    return [value for value in dict.fromkeys([0.0, float(finite.min()), *frequent]) if value != saturated]


def _runs(equal: NDArray[np.bool_]) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
    """Lines, starts and ends of the horizontal runs of at least MIN_RUN_PX."""
    steps = np.diff(np.pad(equal, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    lines, starts = np.nonzero(steps == 1)
    ends = np.nonzero(steps == -1)[1]
    long = ends - starts >= MIN_RUN_PX
    return lines[long], starts[long], ends[long]


def _sides(image: NDArray, run: _Run) -> list[NDArray]:
    """The same columns of the lines right above and below."""
    rows = [row for row in (run.top - 1, run.bottom) if 0 <= row < len(image)]
    return [image[row, run.left : run.right] for row in rows]


def _is_noisy(side: NDArray, run: _Run) -> bool:
    """Whether the pixels beside a run are noise all along, which the run itself can then not be."""
    share = float(np.mean(side == run.value))
    if side.size * np.log(max(share, 1e-3)) > MAX_LOG_CHANCE:
        return False
    segments = np.array_split(np.diff(side) != 0, max(1, min(MAX_SEGMENTS, side.size // MIN_SEGMENT_PX)))
    noisy = sum(float(segment.mean()) >= NOISY_SHARE for segment in segments)
    return noisy >= 0.875 * len(segments)
