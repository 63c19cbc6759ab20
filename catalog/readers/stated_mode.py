"""Summing and window as labels and headers state them, before they are compared with the frame's size."""

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from catalog.flips import PLACES, Flip
from catalog.image_mode import Window
from catalog.readers.label_values import items, number

SUMMINGS = (
    "SUMMING", "BINNING", "SUMMING_MODE", "BINNING_MODE", "MACROPIXEL_SIZE", "PIXEL_AVERAGING_WIDTH", "XBINNING",
    "XBIN", "CCDSUM", "PIXEL_AVERAGING", "NPIXBIN",
)  # fmt: skip
MODE_WORD = re.compile(r"\b(?:SUM|BIN)_?(\d{1,2})\b")  # SUM2 and SUM4 of Cassini
SQUARE = re.compile(r"^\s*(\d{1,2})\s*[xX]\s*\1\s*$")
MODE_WORDS = ("INSTRUMENT_MODE_ID", "FRAME_MODE_ID", "SFORMAT")
SUMMED_WORD = re.compile(r"(?<!NOT )(?<!NO )(?<!NON-)\bSUMM(?:ED|ATION)\b")  # but not UNSUMMED
HALF_SIZE_TELEMETRY = ("HIS", "AI8")  # Galileo's formats of 2x2-summed frames
TELEMETRY = ("TLMFMT", "TELEMETRY_FORMAT_ID")
FIRST_LINES = ("FIRST_LINE", "FIRST_IMAGE_LINE")
FIRST_SAMPLES = ("FIRST_LINE_SAMPLE", "FIRST_SAMPLE")
MAX_SUMMING = 32


@dataclass(frozen=True)
class StatedMode:
    """What a label says. summing: detector pixels along a side of an image pixel, None where it says nothing. window:
    (x0, y0, width, height) in detector pixels, 0-based. first: only (x0, y0) is known. detector: size (nx, ny) of the
    whole detector. source: keywords. contradicted_by: other summings that the label states, and their keywords."""

    summing: int | None = None
    window: Window | None = None
    first: tuple[int, int] | None = None
    detector: tuple[int, int] | None = None
    source: str = ""
    contradicted_by: tuple[tuple[int, str], ...] = ()

    def decided(self, size_px: tuple[int, int], detector_px: tuple[int, int]) -> "StatedMode":
        """Of summings that contradict each other, the one that makes a frame of this size, (nx, ny); itself where none
        or several do."""
        stated = [] if self.summing is None else [(self.summing, self.source), *self.contradicted_by]
        fitting = [each for each in stated if size_px == tuple(side // each[0] for side in detector_px)]
        if len({summing for summing, _ in fitting}) != 1:
            return self
        others = tuple(each for each in stated if each[0] != fitting[0][0])
        return replace(self, summing=fitting[0][0], source=fitting[0][1], contradicted_by=others)


UNSTATED = StatedMode()


def stated_mode(label: Mapping[str, Any]) -> StatedMode:
    """Summing and the window's first pixel out of a flat label's keywords."""
    summings = list(_summings(label))
    summing, keyword = summings[0] if summings else (None, "")
    first, keywords = _first(label)
    others = tuple(each for each in summings[1:] if each[0] != summing)
    source = " and ".join(k for k in (keyword, keywords) if k)
    return StatedMode(summing=summing, first=first, source=source, contradicted_by=others)


def mode_of_alpha_cube(alpha: Mapping[str, Any], shape: tuple[int, int]) -> StatedMode:
    """ISIS' group AlphaCube: the window that a cube was cut from and, by the ratio of sizes, how far it was reduced.

    A reduction by n keeps floor(size / n) pixels, so that n is the whole number nearest to the ratio."""
    keys = ("StartingSample", "StartingLine", "EndingSample", "EndingLine", "Samples", "Lines")
    edges = [number(alpha, f"Alpha{key}") for key in keys]
    if any(value is None for value in edges):
        return UNSTATED
    x0, y0, x1, y1, nx, ny = (float(value or 0.0) for value in edges)
    lines, samples = shape
    ratios = ((x1 - x0) / samples, (y1 - y0) / lines)
    summing = round(ratios[0])
    if not 1 <= summing <= MAX_SUMMING or round(ratios[1]) != summing:
        return UNSTATED
    whole = all(abs(edge - 0.5 - round(edge - 0.5)) < 1e-6 for edge in (x0, y0))
    if not whole or math.floor((x1 - x0) / summing) != samples or math.floor((y1 - y0) / summing) != lines:
        return UNSTATED
    window = (round(x0 - 0.5), round(y0 - 0.5), samples * summing, lines * summing)
    detector = (round(nx), round(ny))
    is_whole = window[:2] == (0, 0) and (detector[0] // summing, detector[1] // summing) == (samples, lines)
    return StatedMode(summing, None if is_whole else window, None, detector, "the group AlphaCube")


def scaled(stated: StatedMode, summing: int) -> StatedMode:
    """A mode that counts in pixels which are sums themselves, in detector pixels."""
    if summing == 1:
        return stated

    def larger(numbers: Any) -> Any:
        return None if numbers is None else tuple(number * summing for number in numbers)

    return StatedMode(
        (stated.summing or 1) * summing,
        larger(stated.window),
        larger(stated.first),
        larger(stated.detector),
        stated.source,
    )


def placed_as_flipped(
    stated: StatedMode, flip: Flip, size_px: tuple[int, int], detector_px: tuple[int, int]
) -> StatedMode:
    """A label's window, which counts in the file's order, where it lies in the picture that was flipped. size_px,
    detector_px: (nx, ny) of the flipped picture, and of the detector that the flipped picture is of."""
    turn = PLACES[flip]
    swaps = bool(turn[0, 0] == 0)
    if stated.window is not None:
        corner, sides = np.array(stated.window[:2], float), np.array(stated.window[2:], float)
    elif stated.first is not None:
        corner, sides = np.array(stated.first, float), np.array(size_px, float) * (stated.summing or 1)
        sides = sides[::-1] if swaps else sides
    else:
        return stated
    detector = np.array(detector_px, float)
    centre = turn @ (corner + sides / 2 - (detector[::-1] if swaps else detector) / 2) + detector / 2
    sides = sides[::-1] if swaps else sides
    x0, y0, width, height = (round(float(value)) for value in (*(centre - sides / 2), *sides))
    if stated.window is not None:
        return replace(stated, window=(x0, y0, width, height))
    return replace(stated, first=(x0, y0))


def mode_of_fits_header(header: Mapping[str, Any]) -> StatedMode:
    """Binning keywords, or IRAF's LTM and LTV, which give each image pixel's place on the detector."""
    summing, keyword = _summing(header)
    if number(header, "XBINNING") and number(header, "YBINNING") not in (None, number(header, "XBINNING")):
        summing, keyword = None, ""
    step = number(header, "LTM1_1")
    if step and 0 < step <= 1 and number(header, "LTM2_2") == step:
        summing, keyword = round(1 / step), "LTM1_1"
        shifts = [number(header, f"LTV{axis}") or 0.0 for axis in (1, 2)]
        first = [round((1.0 - shift) / step - (summing - 1) / 2 - 1.0) for shift in shifts]  # image pixels from 1
        if any(first) and min(first) >= 0:
            return StatedMode(summing, first=(first[0], first[1]), source="LTM and LTV")
    return StatedMode(summing=summing, source=keyword)


def _summing(label: Mapping[str, Any]) -> tuple[int | None, str]:
    return next(_summings(label), (None, ""))


def _summings(label: Mapping[str, Any]) -> Iterator[tuple[int, str]]:
    """Every summing that a label states, with its keyword, in the order in which they count."""
    for key in MODE_WORDS:
        word = str(label.get(key) or "").upper()
        match = MODE_WORD.search(word) or SQUARE.match(word)
        if match and _sane(int(match.group(1))):
            yield int(match.group(1)), key
        elif not match and SUMMED_WORD.search(word.replace("_", " ")):
            yield 2, key
    for key in TELEMETRY:
        if str(label.get(key) or "").strip().upper() in HALF_SIZE_TELEMETRY:
            yield 2, key
    if number(label, "FPU_BINNING_MODE") is not None:  # MESSENGER: on the detector, and afterwards
        on_chip = 2 if number(label, "FPU_BINNING_MODE") == 1 else 1
        later = int(number(label, "PIXEL_BINNING_MODE") or 0) or 1
        if _sane(on_chip * later):
            yield on_chip * later, "FPU_BINNING_MODE and PIXEL_BINNING_MODE"
        return  # its other keywords state one of the two
    for key in SUMMINGS:
        value = label.get(key)
        if isinstance(value, str):
            square = SQUARE.match(value) or re.match(r"^\s*(\d{1,2})(?:\s+\1)?\s*$", value)
            value = int(square.group(1)) if square else None
        sizes = [number({"n": each}, "n") for each in items(value)]
        size = sizes[0] if len(set(sizes)) == 1 else None
        if size is not None and size == int(size) and _sane(int(size)):
            yield int(size), key


def _sane(summing: int) -> int | None:
    return summing if 1 <= summing <= MAX_SUMMING else None


def _first(label: Mapping[str, Any]) -> tuple[tuple[int, int] | None, str]:
    """The window's first pixel, which PDS counts from 1."""
    for line_key, sample_key in ((line, sample) for line in FIRST_LINES for sample in FIRST_SAMPLES):
        line, sample = number(label, line_key), number(label, sample_key)
        if line is not None and sample is not None and min(line, sample) >= 1:
            return (round(sample) - 1, round(line) - 1), f"{line_key} and {sample_key}"
    return None, ""
