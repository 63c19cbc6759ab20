"""Which stretch of time each exposure may speak for, when several speak about the same thing."""

from collections.abc import Sequence
from itertools import pairwise

Window = tuple[float, float]


def windows(
    middles: Sequence[float], before_s: Sequence[float], after_s: Sequence[float], least_s: Sequence[float]
) -> list[Window | None]:
    """Windows from middle - before to middle + after. Of two that overlap both end where they meet: half-way between
    their middles, or as near to that as both reach, so that no gap opens.

    None for those that would be left with less than `least_s` on a side: they are too close to one that came before
    them in the sequence.
    """
    kept: list[int] = []
    for i in range(len(middles)):
        if all(abs(middles[i] - middles[j]) / 2 >= max(least_s[i], least_s[j], 1e-6) for j in kept):
            kept.append(i)
    kept.sort(key=lambda i: middles[i])
    starts = [middles[i] - before_s[i] for i in kept]
    ends = [middles[i] + after_s[i] for i in kept]
    for k, (i, j) in enumerate(pairwise(kept)):
        if ends[k] > starts[k + 1]:
            ends[k] = starts[k + 1] = min(max((middles[i] + middles[j]) / 2, starts[k + 1]), ends[k])
    found: list[Window | None] = [None] * len(middles)
    for i, start, end in zip(kept, starts, ends, strict=True):
        found[i] = (start, end)
    return found
