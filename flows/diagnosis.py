"""The cause that explains a failure, and a folder with what was tried.

The folder is STORE/.failed/PRODUCT: hidden, as what belongs to no product is, and passed over by who reads the store.
It goes when the product is published.
"""

import logging
import shutil
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from catalog.errors import FailedError, PlanetposeError
from flows.chain import Chain
from flows.guided import unhelped
from flows.request import Request
from flows.verdict import CONSEQUENCES, code_of, doubts
from tasks.atomic import folder_put_in_place
from tasks.correcting import Known
from tasks.diagnose.diagnosis import MAP
from tasks.diagnose.failed_folder import FRAME, REQUEST, best_pose, failed_folder, note_result, write_frame
from tasks.diagnose.step import OVERLAY, TRIED, DiagnoseInputs
from tasks.fields import Json
from tasks.record import RECORD_FILE, read_record
from tasks.registry import CLOSEUP, CORRECTIONS, DIAGNOSE, START, VALIDATE
from tasks.scene_inputs import UNIFORM, SceneFiles

logger = logging.getLogger("planetpose")
# Failures that a wrong pose, camera, target or map can have; others name their cause themselves.
EXAMINED = (
    "target-not-found",
    "did-not-converge",
    "range-out-of-bounds",
    "range-unsettled",
    "limb-not-measured",
    "limb-does-not-fit",
    "image-unlike-simulation",
    "no-usable-pixels",
    "joint-not-enough",
)


def diagnose(chain: Chain, error: PlanetposeError, known: Known, files: SceneFiles) -> PlanetposeError:
    """The failure with its cause, as far as the step `diagnose` finds one; else as it was. known, files: as the
    corrections began."""
    if error.code == "interrupted":
        return error
    inputs = diagnose_inputs(chain, known, error.reason, error.code in EXAMINED and not is_close_up(chain))
    found = chain.do(DIAGNOSE, inputs, files).result.diagnosis
    return FailedError(found.code, found.fault, found.remedy) if found else error


def is_close_up(chain: Chain) -> bool:
    """Whether the frame shows too little of the disk for explanations that compare disks."""
    return chain.last(CLOSEUP) is not None


def explain_doubts(chain: Chain, known: Known, files: SceneFiles) -> None:
    """Where all that speaks against a corrected pose may be the consequence of something else, look for that cause:
    `doubts` then names it first. A search that fails leaves the doubts as they are. Raises FailedError when the command
    is interrupted."""
    found = doubts(chain)
    if not found or is_close_up(chain) or not all(code_of(doubt) in CONSEQUENCES for doubt in found):
        return
    try:
        chain.do(DIAGNOSE, diagnose_inputs(chain, known, found[0], True), files)
    except PlanetposeError as error:
        if error.code == "interrupted":
            raise
        logger.warning("%s: no cause could be looked for: %s", chain.request.product, error.reason)


def diagnose_inputs(chain: Chain, known: Known, reason: str, try_explanations: bool) -> DiagnoseInputs:
    """For the step `diagnose`."""
    return DiagnoseInputs(
        scene=known.scene,
        pose=known.predicted,
        product=chain.request.product,
        reason=reason,
        try_explanations=try_explanations,
        settings=chain.request.profile.diagnose,
    )


def without_cause(
    chain: Chain, error: PlanetposeError, known: Known, files: SceneFiles
) -> tuple[Known, SceneFiles] | None:
    """Scene and files of a body without markings, or of an image without another body or stray light, to correct once
    more; what the corrections found before is forgotten. None where the cause is none of these."""
    found = chain.last(DIAGNOSE)
    if found is not None and found.result.replaced:
        scene, files = known.scene.model_copy(update={"observation": found.key}), replace(files, image=found.folder)
    elif error.code == MAP and known.scene.basemap != UNIFORM:
        scene, files = known.scene.model_copy(update={"basemap": UNIFORM}), replace(files, basemap=None)
    else:
        return None
    chain.forget({START.name, *CORRECTIONS, VALIDATE.name}.__contains__)
    return replace(known, scene=scene), files


def failed_without(cause: PlanetposeError, before: PlanetposeError, after: PlanetposeError) -> PlanetposeError:
    """The failure of an image that fails without its cause, too. A base map that is left out in vain is no cause: the
    failure is then the one `before`. Another body or stray light is seen in the image all the same."""
    if cause.code == MAP:
        return before
    return type(after)(cause.code, f"{cause.fault} Corrected so: {after.fault}", after.remedy)


def leave(chain: Chain) -> Path | None:
    """Put what the step `diagnose` left into the store, with the frame and the request, so that somebody can help; its
    folder, None when the image did not come so far, or nothing can be written there."""
    found = chain.last(DIAGNOSE)
    if found is None:
        return None
    folder = failed_folder(chain.request.store, chain.request.product)
    if read_record(folder, found.key) is not None and (folder / FRAME).is_dir():
        return folder
    request = unhelped(chain.request)
    try:
        with folder_put_in_place(folder) as new:
            for name in (OVERLAY, TRIED, RECORD_FILE):
                shutil.copyfile(found.folder / name, new / name)
            write_frame(new / FRAME, found.step.inputs, found.step.files, best_pose(new))
            if request:
                (new / REQUEST).write_text(request, encoding="utf-8")
    except OSError as trouble:  # the image's own fault matters more
        logger.warning("%s was not written: %s", folder, trouble)
        return None
    return folder


def note(folder: Path, result: Json) -> None:
    """Put a failed image's result into its folder, where that can be written."""
    with suppress(OSError):
        note_result(folder, result)


def forget(request: Request) -> None:
    """Take away what was left of an earlier failure."""
    shutil.rmtree(failed_folder(request.store, request.product), ignore_errors=True)
