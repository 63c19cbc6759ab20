"""Whether an image's passes have come to rest."""

from typing import Any

from flows.chain import Chain
from tasks.accept.rest import at_rest
from tasks.registry import ATTITUDE


def settled(chain: Chain, number: int) -> bool:
    """Whether pass `number` changed nothing that matters, or no more than half its error: then another would not."""
    profile = chain.request.profile
    results = [chain.done[f"{correction}-{number}"].result for correction in profile.corrections(number)]
    return at_rest(results, profile.still)


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
