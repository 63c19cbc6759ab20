"""VICAR images whose label carries PDS keywords (Cassini ISS and every camera written that way), or hardly anything.

The keywords are read as every PDS label's (`catalog.readers.keywords`). Host and instrument keywords make the names
that a catalog camera lists in `label_names`.
"""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.observation import Quality
from catalog.readers.gaps import zero_filled
from catalog.readers.keywords import facts_of_keywords
from catalog.readers.label_values import plain_label
from catalog.readers.reading import Reading


def matches(label: dict[str, Any]) -> bool:  # noqa: ARG001
    """Any label will do."""
    return True


def reading(path: Path, label: dict[str, Any], pixels: NDArray[Any]) -> Reading:  # noqa: ARG001
    """Pixels and metadata; whatever the label does not say stays None."""
    facts = facts_of_keywords(label)
    raw = pixels.dtype.kind in "iu" and bool(facts["instrument_names"])
    missing = zero_filled(pixels) if raw else np.zeros(pixels.shape, bool)
    return Reading(
        format="vicar",
        image=pixels,
        quality=np.where(missing, Quality.MISSING, 0).astype(np.uint16),
        raw_dn=raw,
        label=plain_label(label),
        **facts,
    )
