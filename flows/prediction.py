"""The pose that the corrections of an image are about: the metadata's, or one found in the image itself."""

from catalog.errors import WrongOptionError
from catalog.pose import IN_IMAGE
from flows import inputs
from flows.chain import Chain, Done
from flows.request import Request
from tasks.correcting import Known
from tasks.ingest.bodies import NO_BODIES
from tasks.ingest.pose_step import PredictedPose
from tasks.ingest.step import IngestResult
from tasks.priors import PriorSettings
from tasks.registry import IMAGE_POSE, POSE, STARS, UNDISTORT
from tasks.scene_inputs import UNIFORM, SceneInputs
from tasks.stars.separate import StarOrientation
from tasks.undistort.step import UndistortResult


def predicted_pose(chain: Chain, frame: IngestResult) -> tuple[PredictedPose, Done[UndistortResult]]:
    """The predicted pose, and the undistorted image. Raises RefusedError when no source knows the pose."""
    request = chain.request
    if request.pose_is_in_image:
        refuse_company(request)
        undistorted = chain.do(UNDISTORT, *inputs.of_undistort(request, frame))
        found = chain.do(IMAGE_POSE, *inputs.of_image_pose(request, frame, undistorted, chain.kernels))
        return found.result, undistorted
    predicted = chain.do(POSE, *inputs.of_pose(request, frame, chain.kernels)).result
    return predicted, chain.do(UNDISTORT, *inputs.of_undistort(request, frame))


def refuse_company(request: Request) -> None:
    """Raises WrongOptionError where stars or other bodies are wanted of a pose that is found in the image itself: it is
    that of one body before a dark sky, and holds no trajectory that stars could tell from the camera."""
    option = "stars" if request.stars else "body" if request.body and request.body != (NO_BODIES,) else None
    if option is not None:
        fault = f"--{option} needs a predicted pose, and --pose image finds the pose in the image itself."
        raise WrongOptionError(option, fault, f"Leave --{option} out, or give a pose file or kernels.")


def orientation_by_stars(chain: Chain, frame: IngestResult, predicted: PredictedPose) -> StarOrientation | None:
    """The camera's orientation by stars; None where the user wants none looked for, or there are none."""
    if not chain.request.stars:
        return None
    return chain.do(STARS, *inputs.of_stars(chain.request, frame, predicted.pose)).result.orientation


def priors_of(request: Request, scene: SceneInputs, predicted: PredictedPose) -> PriorSettings | None:
    """The predicted pose's own priors: found with it in the image, or stated by its pose file; None without."""
    if predicted.priors or not predicted.errors:
        return predicted.priors
    has_map = scene.basemap.sha256 != UNIFORM.sha256
    return request.profile.joint.priors.of(predicted.sources, has_map, predicted.errors)


def known_at_start(
    request: Request, scene: SceneInputs, predicted: PredictedPose, stars: StarOrientation | None
) -> Known:
    """What is known before the first correction. What was found in the image is looked for nowhere else."""
    own = priors_of(request, scene, predicted)
    priors = own or request.profile.joint.priors.of(predicted.sources)
    pose = predicted.pose if stars is None else stars.predicted(predicted.pose)
    return Known(
        scene,
        pose,
        pose,
        predicted.sources,
        priors.attitude_deg,
        search_frame=predicted.source != IN_IMAGE,
        own_priors=own if stars is None else stars.priors(priors),
        priors=priors if stars is None else stars.priors(priors),
    )
