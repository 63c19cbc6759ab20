"""Whether the corrections of a pass changed nothing that matters."""

from typing import Any

from tasks.accept.settings import StillSettings
from tasks.correction import FORMAL


def at_rest(results: list[dict[str, Any]], still: StillSettings) -> bool:
    """Whether every correction's change of offset (px), range factor and attitude (deg) is within `still`, or within
    half of its own error. results: of the steps, plain."""
    return (
        _small(results, "offset_px", 0.0, still.offset_px)
        and _small(results, "range_factor", 1.0, still.range_factor)
        and _small(results, "attitude_deg", 0.0, still.attitude_deg)
    )


def _small(results: list[dict[str, Any]], key: str, neutral: float, limit: float) -> bool:
    """Whether every step's change of `key` is within `limit` of `neutral`, or within half of its own error by the
    scatter of its residuals."""
    for result in results:
        formal = result.get("evidence", {}).get(FORMAL) or result["uncertainty"]
        changes, errors = _as_list(result["changed"].get(key)), _as_list(formal.get(key))
        errors = errors or [0.0] * len(changes)
        if any(abs(c - neutral) > max(limit, e / 2) for c, e in zip(changes, errors, strict=True)):
            return False
    return True


def _as_list(value: Any) -> list[float]:
    return [] if value is None else list(value) if isinstance(value, list) else [value]
