"""The verdict on a corrected pose: refused, doubtful, or accepted; and whether the passes have converged."""

from collections.abc import Sequence
from typing import Any

from catalog.errors import PlanetposeError
from catalog.readers.overruled import reminder
from flows.chain import Chain
from tasks.accept.acceptance import (
    allowing,
    doubtful_blocks,
    doubtful_blur,
    doubtful_likeness,
    doubtful_limb,
    doubtful_psf,
    doubtful_sun,
    doubtful_target,
    is_about_orientation,
)
from tasks.accept.rest import at_rest
from tasks.diagnose.diagnosis import MAP
from tasks.registry import ATTITUDE, CORRECTIONS, DIAGNOSE, IMAGE_POSE, POINT, POSE, VALIDATE

# Doubts that may be the consequences of another fault, which the step `diagnose` looks for.
CONSEQUENCES = (
    "joint-not-settled",
    "starts-disagree",
    "limb-disagrees",
    "limb-and-interior-disagree",
    "image-unlike-simulation",
    "psf-disagrees",
    "sun-direction-disagrees",
)


def doubts(chain: Chain) -> list[str]:
    """Why the corrected pose is doubtful, each as `code: fault. Remedy.`; empty when nothing speaks against it.

    A correction doubts by a text under `doubt` in its evidence; only the last one of a kind counts.
    """
    last = {done.step.kind.name: done.result for done in chain.done.values()}
    validated, accept = chain.last(VALIDATE), chain.request.profile.accept
    superseded = {POINT.name}
    if validated and is_about_orientation(validated.result.orientation):
        superseded.add(ATTITUDE.name)
    found = [result.doubt for name, result in last.items() if name in CORRECTIONS and name not in superseded]
    if not (validated and validated.result.orientation.verdict == "matched"):  # the markings say which body it is
        found += [result.doubt for result in chain.of_kind(POINT).values()]
    diagnosed = chain.last(DIAGNOSE)
    if diagnosed and not is_of_doubts(chain):
        found.append(diagnosed.result.doubt)
    by_image = chain.last(IMAGE_POSE)
    # What the corrections say is said without what was not found beforehand.
    found = [*(by_image.result.doubts if by_image else ()), *found]
    if validated:
        report = validated.result
        if report.patches is None:
            found += [doubtful_likeness(accept, report.limb), doubtful_limb(accept, report.limb)]
        else:
            found += [doubtful_limb(allowing(accept, report.patches), report.limb)]
        found += [doubtful_sun(accept, report.sun), doubtful_psf(accept, solved_psf(chain), report.limb), report.doubt]
    found = [doubt for doubt in found if doubt]
    found.sort(key=lambda doubt: code_of(doubt) in CONSEQUENCES)  # a cause comes before what may follow from it
    if found and validated:
        spoilt = [doubtful_blocks(accept, validated.result.blocks), doubtful_blur(accept, validated.result.limb)]
        found = [doubt for doubt in (*spoilt, cause_of_doubts(chain)) if doubt] + found
    predicted = chain.last(POSE) or by_image
    unconfirmed = doubtful_target(accept, validated.result, predicted.result) if validated and predicted else None
    return [*found, unconfirmed] if unconfirmed else found


def solved_psf(chain: Chain) -> float | None:
    """1-sigma width, px, of the PSF that the last correction solved for; None where none did."""
    corrections = [done.result for done in chain.done.values() if done.step.kind.name in CORRECTIONS]
    return next((width for result in reversed(corrections) if (width := result.changed.get("psf_sigma_px"))), None)


def code_of(doubt: str) -> str:
    """The first word of a doubt."""
    return doubt.partition(":")[0]


def cause_of_doubts(chain: Chain) -> str | None:
    """What the step `diagnose` found of a pose that was corrected and doubted; None where it was not done, or was
    done before, for a failure."""
    found = chain.last(DIAGNOSE)
    cause = found.result.diagnosis if found and is_of_doubts(chain) else None
    return f"{cause.code}: {cause.fault} {cause.remedy}" if cause and cause.code != MAP else None


def is_of_doubts(chain: Chain) -> bool:
    """Whether the step `diagnose` was done after the pose was validated, and not after a failure."""
    names = list(chain.done)
    return VALIDATE.name in names and names.index(VALIDATE.name) < names.index(DIAGNOSE.name)


def reminded(error: PlanetposeError, overruled: Sequence[str]) -> PlanetposeError:
    """The failure of an image whose label says otherwise than the user: what fails then mostly misleads."""
    if not overruled or error.code == "interrupted":
        return error
    return type(error)(error.code, error.fault, f"{reminder(list(overruled))}{error.remedy}".strip())


def settled(chain: Chain, number: int) -> bool:
    """Whether pass `number` changed nothing that matters, or no more than half its error: then another would not."""
    profile = chain.request.profile
    results = [chain.done[f"{correction}-{number}"].result for correction in profile.corrections(number)]
    return at_rest(results, profile.still)


def rest_reached(chain: Chain) -> dict[str, Any]:
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
