"""Which stretch of time each exposure may speak for, when several speak about the same thing."""

from collections.abc import Sequence

Window = tuple[float, float]


def windows(
    middles: Sequence[float], before_s: Sequence[float], after_s: Sequence[float], least_s: Sequence[float]
) -> list[Window | None]:
    """Windows from middle - before to middle + after, cut half-way to the neighbouring middles so that none overlap.

    None for those that would be left with less than `least_s` on a side: they are too close to one that came before
    them in the sequence.
    """
    kept: list[int] = []
    for i in range(len(middles)):
        if all(abs(middles[i] - middles[j]) / 2 >= max(least_s[i], least_s[j], 1e-6) for j in kept):
            kept.append(i)
    found: list[Window | None] = [None] * len(middles)
    for i in kept:
        gaps = [(middles[j] - middles[i]) / 2 for j in kept if j != i]
        before = min([before_s[i], *(-gap for gap in gaps if gap < 0)])
        after = min([after_s[i], *(gap for gap in gaps if gap > 0)])
        found[i] = (middles[i] - before, middles[i] + after)
    return found
