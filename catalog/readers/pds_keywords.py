"""VICAR images whose label carries PDS keywords (Cassini ISS and every camera written that way), or hardly anything.

Read: IMAGE_MID_TIME, START_TIME, STOP_TIME and IMAGE_TIME, which have to agree; EXPOSURE_DURATION in milliseconds;
TARGET_NAME; FILTER_NAME. Host and instrument keywords make the names that a catalog camera lists in `label_names`.
"""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.observation import Quality
from catalog.readers.exposure_time import Place, claim, exposure_time
from catalog.readers.gaps import zero_filled
from catalog.readers.label_values import number, plain_label, text
from catalog.readers.names import instrument_names, targets_of_label
from catalog.readers.reading import Reading

PLACES: dict[str, Place] = {
    "IMAGE_MID_TIME": "middle",
    "START_TIME": "start",
    "STOP_TIME": "end",
    "IMAGE_TIME": "near",
}


def matches(label: dict[str, Any]) -> bool:  # noqa: ARG001
    """Any label will do."""
    return True


def reading(path: Path, label: dict[str, Any], pixels: NDArray[Any]) -> Reading:  # noqa: ARG001
    """Pixels and metadata; whatever the label does not say stays None."""
    names = instrument_names(label)
    exposure_ms = number(label, "EXPOSURE_DURATION")
    exposure_s = None if exposure_ms is None else exposure_ms / 1000
    claims = [stated for key, place in PLACES.items() for stated in claim(key, text(label, key), place)]
    raw = pixels.dtype.kind in "iu" and bool(names)
    missing = zero_filled(pixels) if raw else np.zeros(pixels.shape, bool)
    return Reading(
        format="vicar",
        image=pixels,
        quality=np.where(missing, Quality.MISSING, 0).astype(np.uint16),
        instrument_names=names,
        targets=targets_of_label(label.get("TARGET_NAME")),
        time=exposure_time(claims, {"EXPOSURE_DURATION": exposure_s}),
        exposure_s=exposure_s,
        filter=text(label, "FILTER_NAME"),
        raw_dn=raw,
        label=plain_label(label),
    )
