"""Correct one image: the paper's figure 1, read from top to bottom.

The same lines run the steps, as Prefect tasks or not, and look up what is already done: see `flows.chain`.
"""

from pathlib import Path
from typing import Any

from catalog.detached import label_beside
from catalog.digest import sha256_of_json
from catalog.errors import PlanetposeError
from catalog.reseau import reseau_table_path
from flows.chain import Chain
from flows.diagnosis import diagnose, failed_without, forget, may_do_without, without_cause
from flows.guidance import guidance_of, is_started_elsewhere, overruled_of, pose_to_resume
from flows.profile import CORRECTIONS
from flows.request import (
    Request,
    basemap_inputs,
    camera_inputs,
    digest_of,
    kernel_inputs,
    kernels_offered,
    projected_target,
    refuse_what_is_no_text,
    target_inputs,
    target_names_digest,
)
from flows.result import profile_origin, result_of
from flows.settling import settled
from flows.verdict import believe, doubts, explained, refuse_doubtful_behind, reminded
from tasks.correction import IMAGE_MOVED
from tasks.publish.origin import PublishStep, note_place, origin_of, refuse_taken

STEP_KINDS = ("ingest", "pose", "undistort", "start", *CORRECTIONS, "validate", "diagnose", "publish", "upload")


def correct_image(chain: Chain) -> None:
    """Do every step for the chain's request. Raises RefusedError or FailedError when a step or the verdict does."""
    refuse_what_is_no_text(chain.request)
    frame = ingest(chain)
    try:
        correct_frame(chain, frame)
    except PlanetposeError as error:
        raise reminded(error, overruled_of(frame)["overruled"]) from error


def correct_frame(chain: Chain, frame: dict[str, Any]) -> None:
    """Every step after `ingest`, whose result `frame` is."""
    refuse_taken(chain.request.product_folder, chain.request.image, frame["sha256"])
    predicted = pose(chain, frame)
    undistort(chain, frame)
    scene, basemap = scene_inputs(chain, frame, predicted)
    try:
        latest, scene, basemap = corrected_pose(chain, scene, basemap)
    except PlanetposeError as error:
        raise explained(error, predicted["pose"]) from error
    publish(chain, frame, latest, scene, basemap)
    forget(chain.request)
    if chain.request.publish_to:
        upload(chain, chain.request.publish_to)


def corrected_pose(
    chain: Chain, scene: dict[str, Any], basemap: dict[str, Any]
) -> tuple[str, dict[str, Any], dict[str, Any]]:
    """`correct_pose`; where it fails, the cause is looked for, and where that is the base map or another body, it is
    done without."""
    try:
        return correct_pose(chain, scene, basemap)
    except PlanetposeError as error:
        cause = diagnose(chain, error, scene, basemap)
        if not may_do_without(chain, cause, scene):
            raise cause from error
        failure = error
        scene, basemap = without_cause(chain, scene, basemap)
    try:
        return correct_pose(chain, scene, basemap)
    except PlanetposeError as error:
        raise failed_without(cause, failure, error) from error


def correct_pose(
    chain: Chain, scene: dict[str, Any], basemap: dict[str, Any]
) -> tuple[str, dict[str, Any], dict[str, Any]]:
    """All passes and the verdict; returns the name of the step that ended with the corrected pose, and `scene` and
    `basemap` with the image that belongs to it."""
    latest = start(chain, scene) if is_started_elsewhere(chain.request) else "pose"
    for number in range(1, chain.request.profile.passes + 1):
        for correction in chain.request.profile.corrections(number):
            latest = correct(chain, correction, number, latest, scene, basemap)
            if IMAGE_MOVED in chain.records[latest].result:
                scene = scene | {"observation": chain.key(latest)}
                basemap = basemap | {"undistort": chain.folder(latest)}
        if number > 1 and settled(chain, number):
            break
    believe(chain.request.profile.accept, validate(chain, latest, scene, basemap))
    refuse_doubtful_behind(chain.records["pose"].result["pose"], doubts(chain))
    return latest, scene, basemap


def ingest(chain: Chain) -> dict[str, Any]:
    """Read the file's metadata."""
    request = chain.request
    inputs = {
        "image": digest_of(request.image, "image"),
        "camera": camera_inputs(request),
        "target_name": target_inputs(request),
        "target_names": target_names_digest(),
        "product": request.product,
    } | flip_inputs(request)
    inputs |= label_inputs(request.image)
    files = image_files(request.image, inputs)
    return chain.do("ingest", "tasks.ingest.step", inputs, image_places(chain), files=files)


def image_files(image: Path, inputs: dict[str, Any]) -> tuple[tuple[Path, str], ...]:
    """The image and its detached label with their digests, as `image_inputs` has them."""
    label = label_beside(image)
    return ((image, inputs["image"]), *(((label, inputs["label"]),) if label and "label" in inputs else ()))


def image_places(chain: Chain) -> dict[str, Any]:
    """Where the image is, and the camera file if the user gave one."""
    return {"image": str(chain.request.image), "camera": chain.request.camera}


def image_inputs(chain: Chain, frame: dict[str, Any]) -> dict[str, Any]:
    """What the pixels and the label depend on."""
    inputs = {"image": frame["sha256"], "camera": frame["camera"]}
    inputs["target_name"] = target_inputs(chain.request)
    return inputs | flip_inputs(chain.request) | label_inputs(chain.request.image)


def flip_inputs(request: Request) -> dict[str, Any]:
    """How the user flips the picture, if at all."""
    return {"flip": request.flip} if request.flip else {}


def label_inputs(image: Path) -> dict[str, str]:
    """The detached label, which readers look for beside the image, by content; nothing when there is none."""
    label = label_beside(image)
    return {"label": digest_of(label, "label")} if label else {}


def pose(chain: Chain, frame: dict[str, Any]) -> dict[str, Any]:
    """Find the predicted pose in pose file, kernels or label."""
    request = chain.request
    pose_file, kernels = request.pose_file, kernels_offered(request.kernel_paths)
    inputs = image_inputs(chain, frame) | {
        "frame": sha256_of_json(frame),
        "pose_file": digest_of(pose_file, "pose file") if pose_file else None,
        "kernels": kernel_inputs(kernels),
    }
    places = image_places(chain) | {
        "pose_file": str(pose_file) if pose_file else None,
        "kernels": [str(path) for path in request.kernel_paths],
    }
    files = (*image_files(request.image, inputs), *((kernel.path, kernel.sha256) for kernel in kernels))
    files += ((pose_file, inputs["pose_file"]),) if pose_file else ()
    return chain.do("pose", "tasks.ingest.pose_step", inputs, places, files=files)


def undistort(chain: Chain, frame: dict[str, Any]) -> None:
    """Make the undistorted image."""
    settings = chain.request.profile.settings_of("undistort")
    inputs = image_inputs(chain, frame) | {"undistorted": frame["undistorted"], "settings": settings}
    inputs |= {"reseau_tables": reseau_digests(frame["camera"], settings)}
    places, files = image_places(chain), image_files(chain.request.image, inputs)
    if chain.request.mask:
        inputs["mask"] = digest_of(chain.request.mask, "mask")
        places["mask"] = str(chain.request.mask)
        files += ((chain.request.mask, inputs["mask"]),)
    chain.do("undistort", "tasks.undistort.step", inputs, places, files=files)


def reseau_digests(camera: dict[str, Any], settings: dict[str, Any]) -> dict[str, str]:
    """Content of the tables of marks that camera and settings name, from the catalog or from files of the user's."""
    named = (camera.get("distortion", {}).get("table"), settings["marks"])
    paths = {str(name): reseau_table_path(str(name)) for name in named if name}
    return {name: digest_of(path, "reseau table") for name, path in paths.items() if path}


def scene_inputs(
    chain: Chain, frame: dict[str, Any], predicted: dict[str, Any]
) -> tuple[dict[str, Any], dict[str, Any]]:
    """What every simulation depends on, and where its base map is."""
    basemap, path = basemap_inputs(chain.request, predicted["target"])
    inputs = {
        "observation": chain.key("undistort"),
        "camera": frame["camera"],
        "target": predicted["target"],
        "basemap": basemap,
        "simulate": chain.request.profile.settings_of("simulate"),
    }
    return inputs, {"undistort": chain.folder("undistort"), "basemap": path}


def pose_inputs(chain: Chain, step: str) -> Any:
    """What the pose that `step` ended with depends on. For the predicted one that is the pose itself: kernels that
    were offered but change nothing redo the step `pose`, and nothing after it."""
    predicted = chain.records["pose"].result["pose"]
    return predicted if step == "pose" else chain.key(step)


def start(chain: Chain, scene: dict[str, Any]) -> str:
    """Find the pose to start from where the user overrules the predicted one; returns the step's name."""
    inputs = {
        "camera": scene["camera"],
        "predicted": pose_inputs(chain, "pose"),
        "start_offset_px": chain.request.start_offset_px,
        "resume": pose_to_resume(chain.request),
    }
    chain.do("start", "tasks.ingest.start_step", inputs, {})
    return "start"


def correct(chain: Chain, correction: str, number: int, latest: str, scene: dict[str, Any], basemap: Any) -> str:
    """One of the corrections; returns the step's name. Only the first pass searches the whole frame, and not when the
    user says where to start."""
    settings = chain.request.profile.settings_of(correction, number)
    if correction == "point" and (number > 1 or "start" in chain.records):
        settings["coarse"] = False
    name = f"{correction}-{number}"
    inputs = scene | {"pose": pose_inputs(chain, latest), "settings": settings}
    places = basemap | {"pose": chain.folder(latest)}
    if correction == "attitude":
        inputs |= {"attitude_prior_deg": attitude_prior_deg(chain)}
    if correction == "joint":
        # Its priors are about the predicted pose, and depend on where its parts come from.
        inputs |= {"predicted": pose_inputs(chain, "pose"), "pose_sources": chain.records["pose"].result["sources"]}
        inputs |= {"markings_match": markings_match(chain)}
        if scene["observation"] != chain.key("undistort"):
            # What the disk tells of the bending is in this image already: asked again it would count twice.
            settings["bending_px"] = None
        places |= {"predicted": chain.folder("pose")}
    chain.do(name, f"tasks.{correction}.step", inputs, places)
    return name


def attitude_prior_deg(chain: Chain) -> float | None:
    """1-sigma of the predicted orientation; None where nothing is known of it."""
    return chain.request.profile.joint.priors.of(chain.records["pose"].result["sources"]).attitude_deg


def markings_match(chain: Chain) -> bool:
    """False where the last attitude step found markings in the image that are not the map's."""
    attitudes = [record.result for name, record in chain.records.items() if name.startswith("attitude-")]
    return not (attitudes and attitudes[-1]["evidence"].get("doubt"))


def validate(chain: Chain, latest: str, scene: dict[str, Any], basemap: dict[str, Any]) -> dict[str, Any]:
    """Compare the limbs, and the markings where the last step did not."""
    inputs = scene | {
        "orientation": chain.records[latest].result.get("evidence", {}).get("orientation"),
        "attitude_prior_deg": attitude_prior_deg(chain),
        "pose": pose_inputs(chain, latest),
        "predicted": pose_inputs(chain, "pose"),
        "settings": chain.request.profile.settings_of("validate"),
    }
    places = basemap | {"pose": chain.folder(latest), "predicted": chain.folder("pose")}
    return chain.do("validate", "tasks.validate.step", inputs, places)


def publish(chain: Chain, frame: dict[str, Any], latest: str, scene: dict[str, Any], basemap: dict[str, Any]) -> None:
    """Project every pixel and write the product into the store."""
    request, origin = chain.request, origin_of(chain.request.product_folder)
    target = projected_target(request, scene["target"])
    files = ((request.shape, target["shape_sha256"]),) if request.shape else ()
    inputs = scene | {
        "target": target,
        "product": request.product,
        "validate": chain.key("validate"),
        "pose": pose_inputs(chain, latest),
        "predicted": pose_inputs(chain, "pose"),
        "profile": request.profile.resolved(),
        "profile_origin": profile_origin(request.profile),
        "guidance": guidance_of(request) | overruled_of(chain.result("ingest")),
    }
    places = basemap | {
        "pose": chain.folder(latest),
        "predicted": chain.folder("pose"),
        "steps": {name: chain.folder(name) for name in chain.records},
        "result": result_of(chain),
        "image": str(request.image),
        "sha256": frame["sha256"],
        "known_places": list(origin.paths) if origin else [],
    }
    chain.do("publish", "tasks.publish.step", inputs, places, request.product_folder, PublishStep, files)
    note_place(request.product_folder, request.image, frame["sha256"])


def upload(chain: Chain, url: str) -> None:
    """Copy the product into the object store."""
    from tasks.objectstore.step import UploadStep

    inputs = {"url": url, "product": chain.request.product, "publish": chain.key("publish")}
    chain.do("upload", "tasks.objectstore.step", inputs, {"folder": chain.folder("publish")}, kind=UploadStep)
