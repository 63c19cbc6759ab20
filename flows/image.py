"""Correct one image: the paper's figure 1, read from top to bottom.

The same lines run the steps, as Prefect tasks or not, and look up what is already done: see `flows.chain`.
"""

from dataclasses import dataclass, replace

from catalog.errors import PlanetposeError
from flows import inputs
from flows.chain import Chain, Done
from flows.diagnosis import diagnose, explain_doubts, failed_without, forget, without_cause
from flows.guided import remember
from flows.prediction import known_at_start, orientation_by_stars, predicted_pose
from flows.request import is_started_elsewhere
from flows.result import result_of, verdict
from flows.verdict import doubts, reminded, settled
from tasks.accept.acceptance import check_report, explained, refuse_doubtful_behind
from tasks.correcting import CorrectionResult, Known, correction_inputs
from tasks.ingest.step import IngestResult
from tasks.publish.origin import note_place, refuse_taken
from tasks.publish.step import PublishResult
from tasks.registry import CLOSEUP, CORRECTIONS, INGEST, PUBLISH, START, UPLOAD, VALIDATE
from tasks.scene_inputs import SceneFiles


@dataclass(frozen=True)
class Corrected:
    """What the corrections have come to. known: pose and scene, as later steps get them. files: where the image is that
    belongs to the pose. last: the latest correction."""

    known: Known
    files: SceneFiles
    last: CorrectionResult | None = None


def correct_image(chain: Chain) -> None:
    """Do every step for the chain's request. Raises RefusedError or FailedError when a step or the verdict does."""
    chain.begin()
    frame = chain.do(INGEST, *inputs.of_ingest(chain.request)).result
    try:
        correct_frame(chain, frame)
    except PlanetposeError as error:
        raise reminded(error, frame.overruled) from error


def correct_frame(chain: Chain, frame: IngestResult) -> None:
    """Every step after `ingest`."""
    request = chain.request
    refuse_taken(request.product_folder, request.image_place, frame.sha256)
    predicted, undistorted = predicted_pose(chain, frame)
    scene, files = inputs.scene_of_image(request, frame, predicted, undistorted)
    stars = orientation_by_stars(chain, frame, predicted)
    known = known_at_start(request, scene, predicted, stars)
    try:
        corrected = corrected_or_explained(chain, Corrected(known, files))
    except PlanetposeError as error:
        raise explained(error, predicted.pose) from error
    product = publish(chain, frame, replace(corrected, known=corrected.known.separated(stars)))
    if not chain.read_only:
        remember(request)
        forget(request)
        note_place(request.product_folder, request.image_place, frame.sha256)
    if request.publish_to:
        chain.do(UPLOAD, *inputs.of_upload(request, request.publish_to, product))


def corrected_or_explained(chain: Chain, start: Corrected) -> Corrected:
    """`corrected_pose`; where it fails, the cause is looked for, and where that is the base map or another body, it is
    done without."""
    try:
        corrected = corrected_pose(chain, start)
    except PlanetposeError as error:
        cause = diagnose(chain, error, start.known, start.files)
        other = without_cause(chain, cause, start.known, start.files)
        if other is None:
            raise cause from error
        failure = error
    else:
        explain_doubts(chain, start.known, start.files)
        return corrected
    try:
        return corrected_pose(chain, Corrected(*other))
    except PlanetposeError as error:
        raise failed_without(cause, failure, error) from error


def corrected_pose(chain: Chain, corrected: Corrected) -> Corrected:
    """All passes and the verdict. Raises FailedError when the image does not confirm the pose."""
    request, known = chain.request, corrected.known
    if is_started_elsewhere(request):
        start = chain.do(START, *inputs.of_start(request, known.scene, known.predicted)).result
        corrected = replace(corrected, known=replace(known, pose=start.pose, search_frame=False))
    if request.profile.takes_for_close_up(corrected.known.pose, corrected.known.scene):
        return validated(chain, correct(chain, CLOSEUP.name, 1, corrected))
    for number in range(1, request.profile.passes + 1):
        for name in request.profile.corrections(number):
            corrected = correct(chain, name, number, corrected)
        if number > 1 and settled(chain, number):
            break
        corrected = replace(corrected, known=replace(corrected.known, search_frame=False))
    return validated(chain, corrected)


def correct(chain: Chain, name: str, number: int, before: Corrected) -> Corrected:
    """One of the corrections: what it changes, later steps get in place of what was there before."""
    step, known, settings = CORRECTIONS[name], before.known, chain.request.profile.settings_of(name, number)
    done = chain.do(step, correction_inputs(step, known, settings), before.files, number=number)
    result, files = done.result, before.files
    known = replace(known, pose=result.pose)
    if result.markings_match is not None:
        known = replace(known, markings_match=result.markings_match)
    if result.image_moved:
        known = replace(known, scene=known.scene.model_copy(update={"observation": done.key}), image_moved=True)
        files = replace(files, image=done.folder)
    return Corrected(known, files, result)


def validated(chain: Chain, corrected: Corrected) -> Corrected:
    """The same, once limbs and markings are compared. Raises FailedError where the image does not confirm the pose."""
    looked_at = inputs.of_validate(chain.request, corrected.known, corrected.last)
    check_report(chain.request.profile.accept, chain.do(VALIDATE, looked_at, corrected.files).result)
    refuse_doubtful_behind(corrected.known.predicted, doubts(chain))
    return corrected


def publish(chain: Chain, frame: IngestResult, corrected: Corrected) -> Done[PublishResult]:
    """Project every pixel and write the product into the store."""
    so_far = verdict(None, doubts(chain)), result_of(chain)
    shown, files, watched = inputs.of_publish(chain, frame, corrected.known, corrected.files, *so_far)
    return chain.do(PUBLISH, shown, files, watched, destination=chain.request.product_folder)
