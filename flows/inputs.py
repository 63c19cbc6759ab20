"""What each step of an image is given, from the user's request and what the steps before it found."""

from pathlib import Path

from catalog.camera import Camera
from catalog.detached import label_beside
from catalog.digest import sha256_of_json
from catalog.input_file import digest_of
from catalog.names_digest import target_names_digest
from catalog.pose import Pose
from catalog.readers import plugin_reader_of
from catalog.reseau import reseau_table_path
from catalog.resumed import pose_to_resume
from catalog.spice import KernelLists, kernel_inputs
from catalog.stars.embedded import EMBEDDED
from catalog.target import Target, find_target, known_target
from flows.chain import Chain, Done
from flows.request import (
    Request,
    basemap_inputs,
    camera_inputs,
    guidance_of,
    projected_target,
    target_inputs,
)
from flows.result import profile_origin
from tasks.code_version import code_version
from tasks.correcting import CorrectionResult, Known
from tasks.fields import Json
from tasks.image_file import ImageFiles, ImageInputs
from tasks.ingest.pose_step import PoseFiles, PoseInputs, PredictedPose
from tasks.ingest.start_step import StartInputs
from tasks.ingest.step import IngestInputs, IngestResult
from tasks.initial_pose.step import ImagePoseFiles, ImagePoseInputs
from tasks.objectstore.step import UploadFiles, UploadInputs
from tasks.publish.origin import origin_of
from tasks.publish.step import PublishFiles, PublishInputs, PublishResult
from tasks.registry import CORRECTIONS, IMAGE_POSE, INGEST, POSE, STEPS
from tasks.scene_inputs import UNIFORM, SceneFiles, SceneInputs
from tasks.stars.step import StarsFiles, StarsInputs
from tasks.undistort import UndistortSettings
from tasks.undistort.step import UndistortFiles, UndistortInputs, UndistortResult
from tasks.validate.step import ValidateInputs
from tasks.work import NoFiles

Watched = tuple[tuple[Path, str], ...]
# What a product says of them enters its key by value: kernels that were offered but change nothing redo no product.
METADATA = (INGEST.name, POSE.name, IMAGE_POSE.name)


def image_inputs(request: Request, sha256: str | None = None) -> ImageInputs:
    """The image's file by content. sha256: of the content that was read already."""
    label = label_beside(request.image)
    return ImageInputs(
        sha256=sha256 or digest_of(request.image, "image"),
        label=digest_of(label, "label") if label else None,
        target=target_inputs(request),
        flip=request.flip,
        reader=plugin_reader_of(request.image),
        plane=request.plane,
        summing=request.summing,
        window=request.window,
    )


def watched_image(request: Request, image: ImageInputs) -> Watched:
    """The image and its detached label, with their digests."""
    label = label_beside(request.image)
    return ((request.image, image.sha256), *(((label, image.label),) if label and image.label else ()))


def of_ingest(request: Request) -> tuple[IngestInputs, ImageFiles, Watched]:
    """For the step `ingest`."""
    image = image_inputs(request)
    inputs = IngestInputs(
        image=image,
        camera=camera_inputs(request),
        target_names=target_names_digest(),
        product=request.product,
    )
    return inputs, ImageFiles(request.image, request.camera_name), watched_image(request, image)


def of_pose(request: Request, frame: IngestResult, lists: KernelLists) -> tuple[PoseInputs, PoseFiles, Watched]:
    """For the step `pose`."""
    image, pose_file = image_inputs(request, frame.sha256), request.pose_path
    kernels = lists.of(request.kernel_paths)
    inputs = PoseInputs(
        image=image,
        camera=frame.camera,
        frame=sha256_of_json(frame.model_dump(mode="json")),
        target=None if image.given_target else known_target(frame.target_name),
        pose_file=digest_of(pose_file, "pose file") if pose_file else None,
        kernels=kernel_inputs(kernels),
        bodies=request.body,
        others=request.profile.simulate.others,
        catalog=target_names_digest() if kernels or request.body else None,
    )
    files = PoseFiles(request.image, request.camera_name, pose_file, tuple(request.kernel_paths))
    watched = (*watched_image(request, image), *((kernel.path, kernel.sha256) for kernel in kernels))
    if pose_file and inputs.pose_file:
        watched += ((pose_file, inputs.pose_file),)
    return inputs, files, watched


def of_undistort(request: Request, frame: IngestResult) -> tuple[UndistortInputs, UndistortFiles, Watched]:
    """For the step `undistort`."""
    image, mask, settings = image_inputs(request, frame.sha256), request.mask, request.profile.undistort
    inputs = UndistortInputs(
        image=image,
        camera=frame.camera,
        undistorted=frame.undistorted,
        settings=settings,
        reseau_tables=reseau_digests(frame.camera, settings),
        mask=digest_of(mask, "mask") if mask else None,
    )
    watched = watched_image(request, image) + (((mask, inputs.mask),) if mask and inputs.mask else ())
    return inputs, UndistortFiles(request.image, request.camera_name, mask), watched


def reseau_digests(camera: Camera, settings: UndistortSettings) -> dict[str, str]:
    """Content of the tables of marks that camera and settings name, from the catalog or from files of the user's."""
    named = (camera.distortion.parameters.get("table"), settings.marks)
    paths = {str(name): reseau_table_path(str(name)) for name in named if name}
    return {name: digest_of(path, "reseau table") for name, path in paths.items() if path}


def of_stars(request: Request, frame: IngestResult, pose: Pose) -> tuple[StarsInputs, StarsFiles, Watched]:
    """For the step `stars`. pose: the predicted one."""
    given, files, watched = of_undistort(request, frame)
    catalog = str(request.stars)
    is_packaged = catalog.lower() in EMBEDDED
    digest = catalog.lower() if is_packaged else digest_of(Path(catalog), "star catalog")
    inputs = StarsInputs(
        image=given.image,
        camera=given.camera,
        undistorted=given.undistorted,
        undistort=given.settings,
        reseau_tables=given.reseau_tables,
        mask=given.mask,
        catalog=digest,
        pose=pose,
    )
    watched += () if is_packaged else ((Path(catalog), digest),)
    return inputs, StarsFiles(files.image, files.camera, files.mask, catalog), watched


def scene_of_image(
    request: Request, frame: IngestResult, predicted: PredictedPose, undistorted: Done[UndistortResult]
) -> tuple[SceneInputs, SceneFiles]:
    """What every simulation depends on, and where its image and base map are."""
    scene, files = mapped_scene(request, frame, predicted.target, undistorted)
    if predicted.has_orientation:
        return scene, files
    # No simulation can say where an unknown orientation has the map's markings.
    return scene.model_copy(update={"basemap": UNIFORM}), SceneFiles(files.image, None)


def mapped_scene(
    request: Request, frame: IngestResult, target: Target, undistorted: Done[UndistortResult]
) -> tuple[SceneInputs, SceneFiles]:
    """The scene of a target with its base map, and where image and map are."""
    basemap, path = basemap_inputs(request, target)
    scene = SceneInputs(
        observation=undistorted.key,
        camera=frame.camera,
        target=target,
        basemap=basemap,
        simulate=request.profile.simulate,
    )
    return scene, SceneFiles(undistorted.folder, path)


def of_image_pose(
    request: Request, frame: IngestResult, undistorted: Done[UndistortResult], lists: KernelLists
) -> tuple[ImagePoseInputs, ImagePoseFiles, Watched]:
    """For the step `image_pose`."""
    kernels = lists.of(request.kernel_paths)
    target = find_target(request.target or frame.target_name, request.kernel_paths)
    scene, files = mapped_scene(request, frame, target, undistorted)
    inputs = ImagePoseInputs(
        scene=scene, et=frame.et, kernels=kernel_inputs(kernels), settings=request.profile.image_pose
    )
    image_files = ImagePoseFiles(files.image, files.basemap, tuple(request.kernel_paths))
    return inputs, image_files, tuple((kernel.path, kernel.sha256) for kernel in kernels)


def of_start(request: Request, scene: SceneInputs, predicted: Pose) -> tuple[StartInputs, NoFiles]:
    """For the step `start`."""
    inputs = StartInputs(
        camera=scene.camera,
        predicted=predicted,
        start_offset_px=request.start_offset_px,
        resume=pose_to_resume(request.resume, request.product),
    )
    return inputs, NoFiles()


def of_validate(request: Request, known: Known, last: CorrectionResult | None) -> ValidateInputs:
    """For the step `validate`. last: the latest correction."""
    return ValidateInputs(
        scene=known.scene,
        pose=known.pose,
        predicted=known.predicted,
        orientation=last.evidence.get("orientation") if last else None,
        attitude_prior_deg=known.attitude_prior_deg,
        patches=last.evidence.get("patches") if last else None,
        settings=request.profile.validate_,
    )


def of_publish(
    chain: Chain, frame: IngestResult, known: Known, files: SceneFiles, verdict: Json, result: Json
) -> tuple[PublishInputs, PublishFiles, Watched]:
    """For the step `publish`. verdict, result: what the product says of itself so far."""
    request, origin = chain.request, origin_of(chain.request.product_folder)
    target = projected_target(request, known.scene.target)
    inputs = PublishInputs(
        scene=known.scene.model_copy(update={"target": target}),
        product=request.product,
        pose=known.pose,
        predicted=known.predicted,
        steps={name: done.key for name, done in chain.done.items() if name not in METADATA},
        verdict=verdict,
        verdict_code=verdict_version(),
        profile=request.profile.resolved(),
        profile_origin=profile_origin(request.profile),
        guidance=guidance_of(request) | {"overruled": list(frame.overruled)},
    )
    product_files = PublishFiles(
        image_folder=files.image,
        steps={name: done.folder for name, done in chain.done.items()},
        corrections=tuple(name for name, done in chain.done.items() if done.step.kind.name in CORRECTIONS),
        result=result,
        image=request.image_place,
        sha256=frame.sha256,
        known_places=origin.paths if origin else (),
    )
    return inputs, product_files, ((request.shape, str(target.shape_sha256)),) if request.shape else ()


def of_upload(request: Request, url: str, product: Done[PublishResult]) -> tuple[UploadInputs, UploadFiles]:
    """For the step `upload`."""
    return UploadInputs(url=url, product=request.product, publish=product.key), UploadFiles(product.folder)


def verdict_version() -> str:
    """Version of the code that puts the steps in order and judges them; the steps have their own."""
    return code_version("flows.image", frozenset(step.module for step in STEPS) | {"tasks.registry"})
