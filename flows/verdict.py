"""What is believed of a corrected pose: refused outright, doubted, or taken."""

from collections.abc import Sequence

from catalog.errors import PlanetposeError
from catalog.readers.overruled import reminder
from flows.chain import Chain
from tasks.accept.judgement import (
    doubtful_blocks,
    doubtful_blur,
    doubtful_likeness,
    doubtful_limb,
    doubtful_sun,
    is_about_orientation,
)
from tasks.diagnose.telling import MAP
from tasks.registry import ATTITUDE, CORRECTIONS, DIAGNOSE, IMAGE_POSE, POINT, VALIDATE

# Doubts that may be the consequences of another fault, which the step `diagnose` looks for.
CONSEQUENCES = (
    "joint-not-settled",
    "starts-disagree",
    "limb-disagrees",
    "limb-and-interior-disagree",
    "image-unlike-simulation",
    "sun-direction-disagrees",
)
PUBLISHED = ("ok", "doubtful")


def doubts(chain: Chain) -> list[str]:
    """Why the corrected pose is doubtful, each as `code: fault. Remedy.`; empty when nothing speaks against it.

    A correction doubts by a text under `doubt` in its evidence; only the last one of a kind is asked.
    """
    last = {done.step.kind.name: done.result for done in chain.done.values()}
    judged, accept = chain.last(VALIDATE), chain.request.profile.accept
    superseded = {POINT.name}
    if judged and is_about_orientation(judged.result.orientation):
        superseded.add(ATTITUDE.name)
    found = [result.doubt for name, result in last.items() if name in CORRECTIONS and name not in superseded]
    if not (judged and judged.result.orientation.verdict == "matched"):  # the markings say which body it is
        found += [result.doubt for result in chain.of_kind(POINT).values()]
    diagnosed = chain.last(DIAGNOSE)
    if diagnosed and not is_of_doubts(chain):
        found.append(diagnosed.result.doubt)
    by_image = chain.last(IMAGE_POSE)
    found += by_image.result.doubts if by_image else ()
    if judged:
        report = judged.result
        found += [doubtful_likeness(accept, report.limb), doubtful_limb(accept, report.limb)]
        found += [doubtful_sun(accept, report.sun), report.doubt]
    found = [doubt for doubt in found if doubt]
    found.sort(key=lambda doubt: code_of(doubt) in CONSEQUENCES)  # a cause is told before what may follow from it
    if found and judged:
        spoilt = [doubtful_blocks(accept, judged.result.blocks), doubtful_blur(accept, judged.result.limb)]
        found = [doubt for doubt in (*spoilt, cause_of_doubts(chain)) if doubt] + found
    return found


def code_of(doubt: str) -> str:
    """The first word of a doubt."""
    return doubt.partition(":")[0]


def cause_of_doubts(chain: Chain) -> str | None:
    """What the step `diagnose` found of a pose that was corrected and doubted; None where it was not asked, or was
    asked before, of a failure."""
    found = chain.last(DIAGNOSE)
    cause = found.result.diagnosis if found and is_of_doubts(chain) else None
    return f"{cause.code}: {cause.fault} {cause.remedy}" if cause and cause.code != MAP else None


def is_of_doubts(chain: Chain) -> bool:
    """Whether the step `diagnose` was done after the pose was judged, and not after a failure."""
    names = list(chain.done)
    return VALIDATE.name in names and names.index(VALIDATE.name) < names.index(DIAGNOSE.name)


def reminded(error: PlanetposeError, overruled: Sequence[str]) -> PlanetposeError:
    """The failure of an image whose label says otherwise than the user: what fails then mostly misleads."""
    if not overruled or error.code == "interrupted":
        return error
    return type(error)(error.code, error.fault, f"{reminder(list(overruled))}{error.remedy}".strip())
