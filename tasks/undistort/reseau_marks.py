"""Find the reseau marks of a raw Voyager frame to a fraction of a pixel."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from catalog.observation import Observation
from catalog.reseau import ReseauTable
from tasks.undistort.mark_fit import MarkFit, fit_marks
from tasks.undistort.mark_search import dark_spots, first_guess, without_copied_edges
from tasks.undistort.smooth_surface import SmoothSurface

ENOUGH_MARKS = 20
MISFIT_PX = 2.0  # error of a mark whose pixels do not look like one at all: where a limb or terminator runs through it
SIGMA_FLOOR_PX = 0.1  # what a good fit still differs by from its neighbours
LIKENESS_NEEDED = 0.6
DEPTH_RANGE = (0.35, 1.9)
LARGEST_SIGMA_PX = 0.35
VISIBLE_FRACTION = 0.5
CONTRAST_NEEDED = 3.0
LARGEST_SURPRISE_PX = 2.0
ASSESSMENT_ROUNDS = 3

Array = NDArray[np.float64]


class MarkState(IntEnum):
    """What became of a mark. OUTSIDE, BLANK and DARK are hidden: nobody could see them."""

    FOUND = 0
    MISSING = 1
    OUTSIDE = 2  # beyond the frame's edge
    BLANK = 3  # the pixels there never arrived
    DARK = 4  # the background is too dark to show it


@dataclass(frozen=True)
class ReseauMarks:
    """Marks of one raw frame. xy (n, 2): measured where found, else expected from the table and the found ones.
    sigma_px (n,): 1-sigma of one coordinate. state (n,): MarkState. depth (n,), NaN where not found. expected_xy
    (n, 2): where the other marks say each one should be; nominal_xy, object_xy as in the table."""

    index: NDArray[np.int64]
    xy: Array
    sigma_px: Array
    state: NDArray[np.int64]
    depth: Array
    expected_xy: Array
    nominal_xy: Array
    object_xy: Array

    @property
    def found(self) -> NDArray[np.bool_]:
        """Mask (n,) of the found marks."""
        return np.asarray(self.state == MarkState.FOUND)

    def counts(self) -> dict[str, int]:
        """How many marks are in each state, by lower-case name."""
        return {state.name.lower(): int((self.state == state).sum()) for state in MarkState}


def find_marks(observation: Observation, table: ReseauTable) -> ReseauMarks:
    """Measure the marks of `table` in a raw frame.

    Dark spots vote for a smooth shift of the table; each mark is then fitted near its expected place, and kept when it
    looks like a mark (shape, depth, uncertainty) and its neighbours agree to `LARGEST_SURPRISE_PX`. With fewer than
    `ENOUGH_MARKS` none is trusted, and the table's places are returned as expected ones.
    """
    observation = without_copied_edges(observation)
    size_px = (observation.image.shape[1], observation.image.shape[0])
    start, seen = first_guess(table.raw_xy, dark_spots(observation), size_px)
    if seen.sum() < ENOUGH_MARKS:
        return _nominal_only(observation, table)
    fit = fit_marks(observation, start)
    good = _looks_right(fit, size_px) & seen
    for _ in range(ASSESSMENT_ROUNDS):
        if good.sum() < ENOUGH_MARKS:
            return _nominal_only(observation, table)
        expected, doubt_px = _expected(table, fit, good, size_px)
        retry = ~good | (np.linalg.norm(fit.xy - expected, axis=1) > LARGEST_SURPRISE_PX)
        fit = _refitted(observation, fit, retry, expected)
        close = np.linalg.norm(fit.xy - expected, axis=1) < LARGEST_SURPRISE_PX
        good = _looks_right(fit, size_px) & close
    expected, doubt_px = _expected(table, fit, good, size_px)
    return _result(observation, table, fit, good, expected, doubt_px)


def _looks_right(fit: MarkFit, size_px: tuple[int, int]) -> NDArray[np.bool_]:
    shape = (fit.likeness > LIKENESS_NEEDED) & (fit.depth > DEPTH_RANGE[0]) & (fit.depth < DEPTH_RANGE[1])
    seen = (fit.visible >= VISIBLE_FRACTION) & (fit.contrast > CONTRAST_NEEDED) & (fit.sigma_px < LARGEST_SIGMA_PX)
    return np.asarray(shape & seen & _inside(fit.xy, size_px))


def _inside(xy: Array, size_px: tuple[int, int]) -> NDArray[np.bool_]:
    return np.asarray(((xy > -0.5) & (xy < np.array(size_px) - 0.5)).all(axis=1))


def _expected(
    table: ReseauTable, fit: MarkFit, good: NDArray[np.bool_], size_px: tuple[int, int]
) -> tuple[Array, Array]:
    """Where all other marks say each mark is (n, 2), and how sure that is (n,), by the smooth shift of the table."""
    sigma = np.hypot(fit.sigma_px[good], SIGMA_FLOOR_PX)
    degree = 3 if good.sum() >= 2 * ENOUGH_MARKS else 1
    surface = SmoothSurface(table.raw_xy[good], fit.xy[good] - table.raw_xy[good], sigma, size_px, degree)
    shift, doubt_px = surface(table.raw_xy), surface.sigma_at(table.raw_xy)
    shift[good] = fit.xy[good] - table.raw_xy[good] - surface.leave_one_out
    return table.raw_xy + shift, np.hypot(doubt_px, SIGMA_FLOOR_PX)


def _refitted(observation: Observation, fit: MarkFit, retry: NDArray[np.bool_], start: Array) -> MarkFit:
    again = fit_marks(observation, start[retry])
    merged = {}
    for name, before in vars(fit).items():
        merged[name] = before.copy()
        merged[name][retry] = getattr(again, name)
    return MarkFit(**merged)


def _result(
    observation: Observation,
    table: ReseauTable,
    fit: MarkFit,
    good: NDArray[np.bool_],
    expected: Array,
    doubt_px: Array,
) -> ReseauMarks:
    measured_px = np.hypot(np.hypot(fit.sigma_px, MISFIT_PX * (1 - fit.likeness)), SIGMA_FLOOR_PX)
    return ReseauMarks(
        index=table.index,
        xy=np.where(good[:, None], fit.xy, expected),
        sigma_px=np.where(good, measured_px, doubt_px),
        state=np.where(good, int(MarkState.FOUND), _why_hidden(observation, expected)),
        depth=np.where(good, fit.depth, np.nan),
        expected_xy=expected,
        nominal_xy=table.raw_xy,
        object_xy=table.object_xy,
    )


def _why_hidden(observation: Observation, expected: Array) -> NDArray[np.int64]:
    size_px = (observation.image.shape[1], observation.image.shape[0])
    there = fit_marks(observation, expected)
    state = np.full(len(expected), int(MarkState.MISSING))
    state[there.contrast <= CONTRAST_NEEDED] = MarkState.DARK
    state[there.visible < VISIBLE_FRACTION] = MarkState.BLANK
    state[~_inside(expected, size_px)] = MarkState.OUTSIDE
    return state


def _nominal_only(observation: Observation, table: ReseauTable) -> ReseauMarks:
    return ReseauMarks(
        index=table.index,
        xy=table.raw_xy,
        sigma_px=np.full(len(table), 1.0),
        state=_why_hidden(observation, table.raw_xy),
        depth=np.full(len(table), np.nan),
        expected_xy=table.raw_xy,
        nominal_xy=table.raw_xy,
        object_xy=table.object_xy,
    )
