"""Under which conditions an image was taken, as far as its camera depends on them."""

import re
from collections.abc import Mapping
from typing import Any

TEMPERATURE_KEYS = ("FOCAL_PLANE_TEMPERATURE", "FOCALPLANETEMPERATURE")
ABSOLUTE_ZERO_C = -273.15
QUANTITY = re.compile(r"[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?")
KELVIN = re.compile(r"(?<![A-Z])(K|KELVIN)(?![A-Z])")


def temperature_of_label(label: Mapping[str, Any]) -> float | None:
    """Temperature of the focal plane in degrees Celsius, None where the label does not state it. Numbers without a unit
    are degrees Celsius; text may hold the unit (`4.07 <DEGC>`, `270.2 <K>`)."""
    known = {str(key).upper().rpartition(".")[2]: value for key, value in label.items()}
    for key in TEMPERATURE_KEYS:
        value = known.get(key)
        value = value[0] if isinstance(value, list | tuple) and value else value
        found = QUANTITY.search(str(value)) if value is not None and not isinstance(value, bool) else None
        if found:
            degrees = float(found[0]) + (ABSOLUTE_ZERO_C if KELVIN.search(str(value).upper()) else 0.0)
            return degrees if degrees >= ABSOLUTE_ZERO_C else None
    return None
