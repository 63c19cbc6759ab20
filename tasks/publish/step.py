"""The cached step: publish. Its folder is the product's folder in the store."""

from dataclasses import asdict, dataclass, replace
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import numpy as np

from catalog.camera import Camera
from catalog.observation import Observation
from catalog.pose import Pose
from tasks.correcting import CorrectionResult
from tasks.fields import Content, Json, PlainJson, PoseField
from tasks.ingest.pose_step import PredictedPose
from tasks.ingest.start_step import StartResult
from tasks.ingest.step import IngestResult
from tasks.project.uncertainty import stated_uncertainty
from tasks.publish.checksums import missing_files
from tasks.publish.names import CUBE, OVERLAY
from tasks.publish.origin import Origin, refuse_taken
from tasks.publish.product import write_product
from tasks.publish.publication import NOT_RESAMPLED, Publication, SensorFrame
from tasks.record import Record, read_record, record_in
from tasks.scene_inputs import SceneInputs
from tasks.separations.measure import separations
from tasks.stars.separate import TOGETHER, separation
from tasks.stars.step import StarsResult
from tasks.step import Step, StepType
from tasks.stored import load_arrays, load_observation
from tasks.summary import calibrated, summary
from tasks.undistort.model import Identity
from tasks.undistort.step import DISTORTION, UndistortResult
from tasks.validate.step import ValidateResult
from tasks.work import Work

LIBRARIES = (
    "planetpose",
    "numpy",
    "scipy",
    "opencv-python-headless",
    "mitsuba",
    "spiceypy",
    "zarr",
    "xarray",
    "prefect",
)


class PublishInputs(Content):
    """What the product depends on. scene: its target is the one that planes are projected on. steps: keys of the steps
    that led to the pose, in the order of doing. verdict: status and reason, as the product states them. verdict_code:
    version of the code that puts the steps in order and judges them."""

    scene: SceneInputs
    product: str
    pose: PoseField
    predicted: PoseField
    steps: dict[str, str]
    verdict: PlainJson
    verdict_code: str
    profile: PlainJson
    profile_origin: PlainJson | None
    guidance: PlainJson


@dataclass(frozen=True)
class PublishFiles:
    """image_folder: of the step that left the undistorted image. steps: folders of all steps, in the order of doing.
    corrections: names of those that corrected the pose. result: what is known of the result so far, plain JSON. image:
    the image's file or address, of the content sha256. known_places: where it was seen before."""

    image_folder: Path
    steps: dict[str, Path]
    corrections: tuple[str, ...]
    result: Json
    image: Path | str
    sha256: str
    known_places: tuple[str, ...]

    @property
    def origin(self) -> Origin:
        """The image of the product, and where it was seen."""
        return Origin(self.sha256, self.known_places).seen_at(self.image, self.sha256)


class PublishResult(Content):
    """correction: see `summary`. cube, overlay: names in the product's folder. image: see `Origin`."""

    correction: PlainJson
    cube: str
    overlay: str
    image: PlainJson


@dataclass(frozen=True)
class Found:
    """Records of all steps by name, and what those say that a product tells of."""

    records: dict[str, Record]
    frame: IngestResult
    predicted: PredictedPose
    undistort: UndistortResult
    start: StartResult | None
    corrections: dict[str, CorrectionResult]
    validate: ValidateResult
    stars: StarsResult | None = None


def run(inputs: PublishInputs, files: PublishFiles, work: Work) -> PublishResult:
    """The product: every pixel projected, cube, result and provenance written into the store (see `write_product`)."""
    found, camera = found_in(files), inputs.scene.camera
    resumed = {"start": found.start.model_dump(mode="json")} if found.start else {}
    stated = calibrated(resumed | {name: result.to_dict() for name, result in found.corrections.items()})
    corrected = summary(inputs.predicted, inputs.pose, camera, stated)
    corrected |= {"roll_by": roll_by(found.corrections), "stars": stars_stated(inputs, found, corrected["uncertainty"])}
    publication = Publication(
        product=inputs.product,
        observation=load_observation(files.image_folder),
        camera=camera,
        target=inputs.scene.target,
        pose_before=inputs.predicted,
        pose_after=inputs.pose,
        uncertainty=stated_uncertainty(stated),
        result={**files.result, **corrected, **stated_of(found.validate, corrected, camera, inputs.pose)},
        settings=dict(inputs.profile),
        provenance=provenance(inputs, found),
    )
    write_product(with_distortion(publication, files.image_folder, found.undistort), work.folder)
    return PublishResult(correction=corrected, cube=CUBE, overlay=OVERLAY, image=files.origin.to_dict())


def found_in(files: PublishFiles) -> Found:
    """What the earlier steps found. Raises OSError or ValueError when a record is gone or damaged."""
    records = {name: record_in(folder) for name, folder in files.steps.items()}
    return Found(
        records=records,
        frame=IngestResult.model_validate(records["ingest"].result),
        predicted=PredictedPose.model_validate((records.get("pose") or records["image_pose"]).result),
        undistort=UndistortResult.model_validate(records["undistort"].result),
        start=StartResult.model_validate(records["start"].result) if "start" in records else None,
        corrections={name: CorrectionResult.model_validate(records[name].result) for name in files.corrections},
        validate=ValidateResult.model_validate(records["validate"].result),
        stars=StarsResult.model_validate(records["stars"].result) if "stars" in records else None,
    )


def stars_stated(inputs: PublishInputs, found: Found, sigma: Json) -> Json:
    """What a result says of stars: the camera's error and the target's apart, or why they are not."""
    stars = found.stars
    if stars is None or stars.orientation is None:
        why = "no stars were looked for (`--stars`)" if stars is None else stars.found["reason"]
        reason = f"{TOGETHER}: {why}"
        return {"stars": 0, "reason": reason}
    apart = separation(
        stars.orientation, found.predicted.pose, inputs.predicted, inputs.pose, inputs.scene.camera, sigma
    )
    left_out = ("image", "camera", "utc", "missing", "warnings")
    return {name: value for name, value in stars.found.items() if name not in left_out} | apart


def roll_by(corrections: dict[str, CorrectionResult]) -> Json | None:
    """By which other bodies' limbs the last correction had the camera's roll (`RollByOthers`); None where by none."""
    last = next(reversed(corrections.values()), None)
    return last.evidence.get("roll_by") if last else None


def with_distortion(publication: Publication, folder: Path, undistort: UndistortResult) -> Publication:
    """The publication with what the step `undistort` left beside the undistorted frame in `folder`."""
    beside = load_arrays(folder / DISTORTION)
    nothing_moved = undistort.model == Identity.name
    sensor = None
    if "sensor_image" in beside:
        observation = Observation(*(beside[f"sensor_{name}"] for name in ("image", "noise", "quality")))
        sensor = SensorFrame(observation, np.stack([beside["sensor_x_px"], beside["sensor_y_px"]], axis=-1))
    return replace(
        publication,
        distortion_uncertainty_px=beside["uncertainty_px"],
        kernel=NOT_RESAMPLED if nothing_moved else undistort.evidence["kernel"],
        sensor=sensor,
    )


def stated_of(report: ValidateResult, correction: Json, camera: Camera, pose: Pose) -> Json:
    """What a result states of the step `validate`'s findings. correction: see `summary`."""
    limb, orientation = report.limb, report.orientation
    return {
        "orientation": {"markings": orientation.verdict, "sigmas": orientation.sigmas, "kept": orientation.kept},
        "bodies": separations(report.bodies, correction, camera, pose.range_km),
        "limb_rms_px": limb.rms_px,
        "limb_points": limb.points,
        "limb_robust_px": limb.robust_px,
        "limb_disagreeing": limb.disagreeing,
        "similarity": report.similarity.model_dump(mode="json"),
        "patches": stated_patches(report.patches),
    }


def stated_patches(patches: Json | None) -> Json | None:
    """What confirms a close-up, without the single patches, which the provenance has; None of other images."""
    return patches and {key: value for key, value in patches.items() if not isinstance(value, list)}


def provenance(inputs: PublishInputs, found: Found) -> Json:
    """Where everything came from: files and hashes, label, kernels, map, every step with its key and code version."""
    frame, predicted, records = found.frame, found.predicted, found.records
    return {
        "image": frame.model_dump(mode="json", include={"product", "sha256", "format", "exposure_s", "filter"}),
        "label": frame.label,
        "initial_pose": predicted.model_dump(
            mode="json", include={"source", "sources", "missing", "evidence", "priors"}
        ),
        "kernels": list(predicted.kernels),
        "basemap": inputs.scene.basemap.model_dump(mode="json"),
        "undistort": found.undistort.model_dump(mode="json"),
        "profile_origin": inputs.profile_origin,
        "guidance": dict(inputs.guidance),
        "start": records["start"].inputs if "start" in records else None,
        "corrections": {name: result.to_dict() for name, result in found.corrections.items()},
        "limb": found.validate.limb.model_dump(mode="json"),
        "sun": asdict(found.validate.sun),
        "steps": {
            name: {"key": r.key, "code": r.code, "seconds": r.seconds, "written": r.written}
            for name, r in records.items()
        },
        "software": versions(),
    }


@cache
def versions() -> dict[str, str]:
    """Installed versions of this program and of the libraries whose results it passes on."""
    found = {}
    for name in LIBRARIES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


def refuse_other(step: Step[PublishInputs, PublishFiles, PublishResult]) -> None:
    """See `refuse_taken`."""
    refuse_taken(step.folder, step.files.image, step.files.sha256)


def whole_record(step: Step[PublishInputs, PublishFiles, PublishResult]) -> Record | None:
    """The record of a product of which no file is missing, so that one that lost some is published again. The overlay
    may be deleted: `planetpose show` draws it."""
    record = read_record(step.folder, step.key)
    return None if record is None or set(missing_files(step.folder)) - {OVERLAY} else record


STEP = StepType(
    "publish",
    run,
    PublishResult,
    find_record=whole_record,
    labels={"scene.target": "shape", "verdict_code": "code of the verdict"},
    check_place=refuse_other,
)
