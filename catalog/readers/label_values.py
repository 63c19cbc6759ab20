"""Typed values out of labels of any dialect: missing or senseless ones become None."""

import math
import re
from collections.abc import Mapping
from typing import Any

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
    parts = items(value)
    words = [str(part).strip() for part in parts if part is not None]
    joined = "/".join(word for word in words if word)
    return None if joined.upper() in ("", "N/A", "UNK", "NULL") else joined


def items(value: Any) -> list[Any]:
    """What a label's value consists of: the items of a sequence, those of a set by name, else the value itself."""
    if isinstance(value, (set, frozenset)):
        return sorted(value, key=str)
    return list(value) if isinstance(value, (list, tuple)) else [value]


def plain(value: Any) -> Any:
    """A label value as plain JSON: strings, finite numbers, booleans, lists; anything else as text."""
    if isinstance(value, (list, tuple, set, frozenset)):
        return [plain(item) for item in items(value)]
    if isinstance(value, float):
        return value if math.isfinite(value) else str(value)
    return value if isinstance(value, (str, int, bool)) or value is None else str(value)


def plain_label(label: Mapping[str, Any]) -> dict[str, Any]:
    """The whole label as plain JSON values."""
    return {str(key): plain(value) for key, value in label.items()}
