"""Whether the corrections of a pass changed nothing that matters."""

from tasks.accept.settings import StillSettings
from tasks.correcting import CorrectionResult


def at_rest(results: list[CorrectionResult], still: StillSettings) -> bool:
    """Whether every correction's change of offset (px), range factor and attitude (deg) is within `still`, or within
    half of its own error."""
    return (
        _small(results, "offset_px", 0.0, still.offset_px)
        and _small(results, "range_factor", 1.0, still.range_factor)
        and _small(results, "attitude_deg", 0.0, still.attitude_deg)
    )


def _small(results: list[CorrectionResult], key: str, neutral: float, limit: float) -> bool:
    """Whether every step's change of `key` is within `limit` of `neutral`, or within half of its own error by the
    scatter of its residuals."""
    for result in results:
        changes, errors = _as_list(result.changed.get(key)), _as_list(result.formal.get(key))
        errors = errors or [None] * len(changes)
        for change, error in zip(changes, errors, strict=True):
            if change is None or abs(change - neutral) > max(limit, (error or 0.0) / 2):
                return False
    return True


def _as_list(value: float | list[float | None] | None) -> list[float | None]:
    return [] if value is None else list(value) if isinstance(value, list) else [value]
