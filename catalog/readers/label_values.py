"""Typed values out of labels of any dialect: missing or senseless ones become None."""

import math
import re
from collections.abc import Mapping
from typing import Any

from catalog.times import et_from_utc

UNKNOWN_NUMBER = -999.0  # Galileo's and New Horizons' "not known"


def number(label: Mapping[str, Any], key: str) -> float | None:
    """A finite number, or None when it is absent, no number, or the missions' -999."""
    value = label.get(key)
    if isinstance(value, str):
        match = re.match(r"\s*[-+]?(\d+\.?\d*|\.\d+)([eEdD][-+]?\d+)?", value)
        value = float(match.group(0).replace("D", "E").replace("d", "e")) if match else None
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return None
    return float(value) if math.isfinite(value) and value != UNKNOWN_NUMBER else None


def text(label: Mapping[str, Any], key: str) -> str | None:
    """A stripped string; several (two filter wheels) are joined by '/'. None when absent or N/A."""
    value = label.get(key)
    parts = value if isinstance(value, (list, tuple)) else [value]
    words = [str(part).strip() for part in parts if part is not None]
    joined = "/".join(word for word in words if word)
    return None if joined.upper() in ("", "N/A", "UNK", "NULL") else joined


def et(utc: str | None) -> float | None:
    """TDB seconds past J2000 of a UTC text, None when it is absent or no time."""
    if not utc:
        return None
    try:
        return et_from_utc(utc)
    except (ValueError, IndexError, OverflowError):
        return None


def middle_et(start_utc: str | None, stop_utc: str | None) -> float | None:
    """Middle of an exposure, TDB seconds past J2000, from its two ends; None unless both are times."""
    start, stop = et(start_utc), et(stop_utc)
    return None if start is None or stop is None else (start + stop) / 2


def plain(value: Any) -> Any:
    """A label value as plain JSON: strings, finite numbers, booleans, lists; anything else as text."""
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else str(value)
    return value if isinstance(value, (str, int, bool)) or value is None else str(value)


def plain_label(label: Mapping[str, Any]) -> dict[str, Any]:
    """The whole label as plain JSON values."""
    return {str(key): plain(value) for key, value in label.items()}
