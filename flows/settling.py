"""Whether an image's passes have come to rest."""

from typing import Any

from flows.chain import Chain
from tasks.correcting import CorrectionResult
from tasks.registry import ATTITUDE


def settled(chain: Chain, number: int) -> bool:
    """Whether pass `number` changed nothing that matters, or no more than half its error: then another would not."""
    profile = chain.request.profile
    still = profile.still
    results = [chain.done[f"{correction}-{number}"].result for correction in profile.corrections(number)]
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
        errors = errors or [0.0] * len(changes)
        if any(abs(c - neutral) > max(limit, e / 2) for c, e in zip(changes, errors, strict=True)):
            return False
    return True


def _as_list(value: Any) -> list[float]:
    return [] if value is None else list(value) if isinstance(value, list) else [value]


def settling(chain: Chain) -> dict[str, Any]:
    """`settled` of the result: passes, how many were begun; pose, whether the last of them changed nothing that matters
    (None after a single one); attitude, whether turning the body came to rest (None when it is undetermined)."""
    numbers = [int(name.partition("-")[2]) for name in chain.done if "-" in name]
    if not numbers:
        return {}
    number = max(numbers)
    complete = all(f"{step}-{number}" in chain.done for step in chain.request.profile.corrections(number))
    turn = chain.last(ATTITUDE)
    return {
        "settled": {
            "passes": number,
            "pose": settled(chain, number) if number > 1 and complete else None,
            "attitude": turn.result.evidence.get("settled") if turn else None,
        }
    }
