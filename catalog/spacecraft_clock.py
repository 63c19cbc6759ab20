"""The middle of an exposure by the spacecraft's clock: labels of some missions round their times, or had them made by
an older clock kernel than the one that the orientation is looked up with."""

import math
from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel, ConfigDict, Field

from catalog.spice import spice_message
from catalog.times import utc_from_et

SAME_EXPOSURE_S = 60.0
"""A clock that is farther from the label's time has been misread."""


class SpacecraftClock(BaseModel):
    """How a label's clock count gives the exposure. clock_id: of the clock in SCLK kernels, where it is not the
    spacecraft's. keywords: of the count, in the order in which they are looked for. begins_after_s: pairs (exposure up
    to, seconds from the count to the beginning of the exposure), in seconds."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    clock_id: int | None = None
    keywords: tuple[str, ...] = ("SPACECRAFT_CLOCK_START_COUNT", "SPACECRAFT_CLOCK_COUNT")
    begins_after_s: tuple[tuple[float, float], ...] = Field(default=((math.inf, 0.0),), min_length=1)

    def count(self, label: Mapping[str, Any]) -> str | None:
        """The count that a flat label gives, without its unit."""
        values = (
            str(label[keyword]).partition("<")[0].strip(" '\"") for keyword in self.keywords if label.get(keyword)
        )
        return next((value for value in values if value[:1].isdigit()), None)

    def middle_et(self, count: str, exposure_s: float, spacecraft_id: int | None) -> float | None:
        """TDB seconds past J2000 of mid-exposure, by the SCLK kernels that are loaded; None for a count or an exposure
        that they do not cover. Raises SpiceyError, in SPICE's words, where no such clock is loaded."""
        import spiceypy

        clock_id = self.clock_id or spacecraft_id
        after_s = next((seconds for longest, seconds in self.begins_after_s if exposure_s <= longest), None)
        if clock_id is None or after_s is None:
            return None
        return float(spiceypy.scs2e(clock_id, count)) + after_s + exposure_s / 2


def et_by_clock(
    clock: SpacecraftClock | None,
    label: Mapping[str, Any],
    exposure_s: float | None,
    spacecraft_id: int | None,
    label_et: float | None,
) -> tuple[float | None, str | None]:
    """Mid-exposure by the clock kernels that are loaded, and why it is not taken where the label gives a count; both
    None where it gives none."""
    from spiceypy.utils.exceptions import SpiceyError

    count = None if clock is None or exposure_s is None else clock.count(label)
    if clock is None or exposure_s is None or count is None:
        return None, None
    try:
        et = clock.middle_et(count, exposure_s, spacecraft_id)
    except SpiceyError as error:
        return None, f"SCLK: the label's clock count {count} ({spice_message(error)})"
    if et is not None and label_et is not None and abs(et - label_et) > SAME_EXPOSURE_S:
        return None, f"SCLK: the clock count {count} is {utc_from_et(et)}, the label says {utc_from_et(label_et)}"
    return et, None
