"""VICAR images whose label carries PDS keywords (Cassini ISS and every camera written that way), or hardly anything.

Read: IMAGE_MID_TIME, or the middle of START_TIME and STOP_TIME; EXPOSURE_DURATION in milliseconds; TARGET_NAME;
FILTER_NAME. Host and instrument keywords make the names that a catalog camera lists in `label_names`.
"""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.observation import Quality
from catalog.readers.gaps import zero_filled
from catalog.readers.label_values import et, middle_et, number, plain_label, text
from catalog.readers.names import instrument_names, target_of_label
from catalog.readers.reading import Reading


def matches(label: dict[str, Any]) -> bool:  # noqa: ARG001
    """Any label will do."""
    return True


def reading(path: Path, label: dict[str, Any], pixels: NDArray[Any]) -> Reading:  # noqa: ARG001
    """Pixels and metadata; whatever the label does not say stays None."""
    names = instrument_names(label)
    exposure_ms = number(label, "EXPOSURE_DURATION")
    raw = pixels.dtype.kind in "iu" and bool(names)
    missing = zero_filled(pixels) if raw else np.zeros(pixels.shape, bool)
    return Reading(
        format="vicar",
        image=pixels,
        quality=np.where(missing, Quality.MISSING, 0).astype(np.uint16),
        instrument_names=names,
        target=target_of_label(text(label, "TARGET_NAME")),
        et=et(text(label, "IMAGE_MID_TIME")) or middle_et(text(label, "START_TIME"), text(label, "STOP_TIME")),
        exposure_s=None if exposure_ms is None else exposure_ms / 1000,
        filter=text(label, "FILTER_NAME"),
        raw_dn=raw,
        label=plain_label(label),
    )
