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
from tasks.registry import ATTITUDE, CORRECTIONS, DIAGNOSE, VALIDATE

DOUBTING = (*CORRECTIONS, DIAGNOSE.name)
PUBLISHED = ("ok", "doubtful")


def doubts(chain: Chain) -> list[str]:
    """Why the corrected pose is doubtful, each as `code: fault. Remedy.`; empty when nothing speaks against it.

    A correction doubts by a text under `doubt` in its evidence; only the last one of a kind is asked.
    """
    last = {done.step.kind.name: done.result for done in chain.done.values()}
    judged, accept = chain.last(VALIDATE), chain.request.profile.accept
    superseded = {ATTITUDE.name} if judged and is_about_orientation(judged.result.orientation) else set()
    found = [result.doubt for name, result in last.items() if name in DOUBTING and name not in superseded]
    if judged:
        report = judged.result
        found += [doubtful_likeness(accept, report.limb), doubtful_limb(accept, report.limb)]
        found += [doubtful_sun(accept, report.sun), report.doubt]
    found = [doubt for doubt in found if doubt]
    if found and judged:
        spoilt = [doubtful_blocks(accept, judged.result.blocks), doubtful_blur(accept, judged.result.limb)]
        found = [doubt for doubt in spoilt if doubt] + found
    return found


def reminded(error: PlanetposeError, overruled: Sequence[str]) -> PlanetposeError:
    """The failure of an image whose label says otherwise than the user: what fails then mostly misleads."""
    if not overruled or error.code == "interrupted":
        return error
    return type(error)(error.code, error.fault, f"{reminder(list(overruled))}{error.remedy}".strip())
