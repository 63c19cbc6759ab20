"""What is believed of a corrected pose: refused outright, doubted, or taken."""

from catalog.errors import PlanetposeError
from catalog.readers.overruled import reminder
from flows.chain import Chain
from tasks.accept.judgement import (
    doubtful_blur,
    doubtful_likeness,
    doubtful_limb,
    doubtful_sun,
    is_about_orientation,
)

PUBLISHED = ("ok", "doubtful")


def doubts(chain: Chain) -> list[str]:
    """Why the corrected pose is doubtful, each as `code: fault. Remedy.`; empty when nothing speaks against it.

    A correction doubts by a text under `doubt` in its evidence; only the last one of a kind is asked.
    """
    last = {name.partition("-")[0]: record.result for name, record in chain.records.items()}
    superseded = {"attitude"} if is_about_orientation(last) else set()
    found = [result.get("evidence", {}).get("doubt") for kind, result in last.items() if kind not in superseded]
    accept = chain.request.profile.accept
    if "validate" in last:
        report = last["validate"]
        found += [doubtful_likeness(accept, report), doubtful_limb(accept, report)]
        found += [doubtful_sun(accept, report), report.get("doubt")]
    found = [doubt for doubt in found if doubt]
    if found and "validate" in last and (blurred := doubtful_blur(accept, last["validate"])):
        found.insert(0, blurred)
    return found


def reminded(error: PlanetposeError, overruled: list[str]) -> PlanetposeError:
    """The failure of an image whose label says otherwise than the user: what fails then mostly misleads."""
    if not overruled or error.code == "interrupted":
        return error
    return type(error)(error.code, error.fault, f"{reminder(overruled)}{error.remedy}".strip())
