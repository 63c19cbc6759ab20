"""The cached step: validate."""

from typing import NamedTuple

import numpy as np
from pydantic import Field

from catalog.observation import Observation, Quality
from catalog.pose import Pose
from tasks.attitude.markings import UNKNOWN_DEG, Markings, markings_at_pose, mismatch_of
from tasks.attitude.symmetry import Symmetry, better_flip, doubt_of_symmetry
from tasks.bodies.masks import alone, disk_of
from tasks.bodies.placed import bodies_of
from tasks.compare.brightness import fit_brightness
from tasks.compare.match import framed_window, match_scene
from tasks.compare.similarity import ssim
from tasks.fields import Content, PlainJson, PoseField
from tasks.plain import plain
from tasks.scene_inputs import SceneFiles, SceneInputs, scene_of
from tasks.separations.measure import MeasuredBody, measured_bodies
from tasks.simulate import Scene
from tasks.step import StepType
from tasks.stored import load_observation, save_arrays
from tasks.validate import ValidateSettings, validate_limb
from tasks.validate.blocks import blocks_of
from tasks.validate.dark_limb import NOT_SEEN, dark_limb, doubt_of_dark_limb
from tasks.validate.limb import LimbFigures, LimbReport, margin_px
from tasks.validate.sun import SunReport, sun_in_image
from tasks.work import Work

# Sub-pixels across the disk of the picture before: its similarity need only be right to 0.001.
ACROSS_BEFORE = 400.0
# The Sun's direction is solved for where more than this share of the disk is left by other bodies: with less, laws and
# maps moved it by 4 to 11 deg at a stated 1.5 (moons behind Saturn's rings, `planetpose benchmark bodies`).
MOST_OF_DISK = 0.75


class ValidateInputs(Content):
    """What the result depends on. orientation: what the last correction found of the markings, None where it did not
    look. attitude_prior_deg: 1-sigma of the predicted orientation, None if unknown. patches: what confirms a close-up,
    in place of a whole limb; None of other images."""

    scene: SceneInputs
    pose: PoseField
    predicted: PoseField
    orientation: PlainJson | None
    attitude_prior_deg: float | None
    patches: PlainJson | None = None
    settings: ValidateSettings


class Similarity(Content):
    """Of image and simulation, under the predicted and under the corrected pose; None outside the frame."""

    before: float | None
    after: float | None


class OrientationReport(Content):
    """What the markings say of the body's orientation. verdict, sigmas: see `Markings`. kept: why the predicted one was
    kept, if it was. evidence: all that is known of it."""

    verdict: str
    sigmas: float | None
    kept: str | None = None
    evidence: PlainJson = Field(default_factory=dict)


class ValidateResult(Content):
    """limb: see `LimbReport`. sun: see `SunReport`. blocks: see `blocks_of`. bodies: the frame's others. doubt: why the
    pose is doubtful, None when nothing says so."""

    limb: LimbFigures
    similarity: Similarity
    sun: SunReport
    blocks: float | None
    dark_limb: PlainJson
    orientation: OrientationReport
    symmetry: PlainJson | None
    bodies: tuple[MeasuredBody, ...] = ()
    doubt: str | None
    patches: PlainJson | None = None


def run(inputs: ValidateInputs, files: SceneFiles, work: Work) -> ValidateResult:
    """Limb, similarity, Sun, orientation and blocks of a compression under the corrected pose (see `validate_limb`,
    `sun_in_image`, `blocks_of`)."""
    scene, pose = scene_of(inputs.scene, files), inputs.pose
    everything = load_observation(files.image)
    observation = alone(everything, pose, scene)
    report = validate_limb(observation, pose, scene, inputs.settings)
    save_arrays(work.folder, xy_px=report.xy_px, shift_px=report.shift_px, horizontal=report.horizontal)
    before = similarity_before(observation, inputs.predicted, scene, inputs.settings)
    if inputs.patches is not None:
        return of_close_up(report, before, observation, inputs)
    outside = dark_limb(observation, pose, scene)
    oriented = orientation_of(observation, pose, scene, inputs)
    doubts = [*oriented.doubts, doubt_of_dark_limb(outside)]
    return ValidateResult(
        limb=report.figures(),
        similarity=Similarity(before=before, after=plain(report.similarity)),
        sun=sun_in_image(observation, pose, scene)
        if left_share(observation, pose, scene) > MOST_OF_DISK
        else SunReport(),
        blocks=blocks_of(observation),
        dark_limb=outside.to_dict(),
        orientation=oriented.report,
        symmetry=oriented.symmetry.to_dict() if oriented.symmetry else None,
        bodies=measured_bodies(everything, pose, scene),
        doubt=" ".join(doubt for doubt in doubts if doubt) or None,
    )


def left_share(observation: Observation, pose: Pose, scene: Scene) -> float:
    """Share of the target's disk within the frame that other bodies, their shadows and rings leave."""
    if not pose.bodies and not scene.target.rings:
        return 1.0
    own = next(body for body in bodies_of(pose, scene.target) if body.place is None)
    disk = disk_of(own, scene.camera)
    left = (observation.quality[disk] & np.uint16(Quality.OTHER_BODY)) == 0
    return float(left.mean()) if left.size else 0.0


def of_close_up(
    report: LimbReport, before: float | None, observation: Observation, inputs: ValidateInputs
) -> ValidateResult:
    """Of a frame that shows too little of the disk for its shading, its dark limb or a flip of it to tell anything."""
    found = inputs.orientation or {"verdict": "undetermined"}
    return ValidateResult(
        limb=report.figures(),
        similarity=Similarity(before=before, after=plain(report.similarity)),
        sun=SunReport(),
        blocks=blocks_of(observation),
        dark_limb=NOT_SEEN.to_dict(),
        orientation=OrientationReport(
            verdict=found["verdict"], sigmas=found.get("sigmas"), kept=found.get("kept"), evidence=plain(found)
        ),
        symmetry=None,
        doubt=None,
        patches=inputs.patches,
    )


class Oriented(NamedTuple):
    """What the markings say of the orientation, a flip of the picture that fits better, and the doubts that follow."""

    report: OrientationReport
    symmetry: Symmetry | None
    doubts: list[str]


def orientation_of(observation: Observation, pose: Pose, scene: Scene, inputs: ValidateInputs) -> Oriented:
    """What the markings say of the orientation, unless an earlier step found out."""
    prior_deg = inputs.attitude_prior_deg or UNKNOWN_DEG
    found = inputs.orientation
    doubts = []
    if found is None:
        markings = markings_at_pose(observation, pose, scene, prior_deg)
        found = {**markings.to_dict(), "kept": None}
        if markings.verdict == "mismatched":
            doubts.append(mismatch_of(markings))
    else:
        markings = Markings(found["verdict"], found["correlation"], found["sigmas"])
    symmetry = better_flip(observation, pose, scene, markings, prior_deg)
    if symmetry is not None:
        doubts.append(doubt_of_symmetry(symmetry))
    report = OrientationReport(
        verdict=markings.verdict, sigmas=markings.sigmas, kept=found["kept"], evidence=plain(found)
    )
    return Oriented(report, symmetry, doubts)


def similarity_before(observation: Observation, pose: Pose, scene: Scene, settings: ValidateSettings) -> float | None:
    """Similarity under the predicted pose; None when it puts the target outside the frame."""
    ny, nx = observation.image.shape
    try:
        window = scene.window(pose).clipped((nx, ny))
    except ValueError:  # behind the camera
        return None
    if min(window.shape) < 1:
        return None
    window = framed_window(scene, pose, margin_px=margin_px(settings))
    match = match_scene(observation, scene.coarser(pose, ACROSS_BEFORE), pose, window)
    similarity: float | None = plain(ssim(match.image, fit_brightness(match, match.simulation.bases)[0], match.usable))
    return similarity


STEP = StepType("validate", run, ValidateResult, ValidateSettings, labels={"scene.basemap": "base map"})
