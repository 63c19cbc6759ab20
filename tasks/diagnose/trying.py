"""What is tried where an image has no corrected pose: each explanation changes one thing, and is fitted to the limb.

The base map's markings are left out: outline and shading tell where the target is, how large, and how it is lit. Each
family of explanations is searched over the whole frame at low resolution; its best one is then settled by the limb.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from catalog.basemap import uniform_map
from catalog.errors import FailedError
from catalog.observation import Observation
from catalog.pose import Pose
from tasks.compare.brightness import brightness_columns, correlation, robust_least_squares
from tasks.compare.likeness import with_rim
from tasks.compare.reduce import reduced_observation, reduced_scene, reduction_for
from tasks.diagnose.others import without_others
from tasks.diagnose.settings import DiagnoseSettings
from tasks.diagnose.suns import sun_azimuth_deg, with_sun
from tasks.joint.parameters import rolled
from tasks.point.coarse import CoarseFind, find_target
from tasks.point.loop import likeness_at, share_in_frame
from tasks.range.limb import LimbRangeSettings, find_range_by_limb
from tasks.simulate import Scene
from tasks.simulate.window import disk_radius_px
from tasks.validate.limb import ValidateSettings, validate_limb

Name = Literal["as-predicted", "other-body", "size", "sun", "mirrored", "rolled", "inverted"]
Progress = Callable[[str, int, str], None]
MIN_OVERLAP = 0.25
SETTLING = LimbRangeSettings(stop_px=0.5, max_iterations=12, limit=0.3, across=200)
VALIDATE = ValidateSettings()
# Sub-pixels across the disk of the renderings: the limb need only be right to a tenth of a pixel.
ACROSS = 300.0
SEARCH_OVERSAMPLE = 2
FEWEST_PIXELS = 100


@dataclass(frozen=True)
class Candidate:
    """One thing changed: the pose, or the picture. detail: by how much, in the family's own measure."""

    name: Name
    detail: float
    observation: Observation
    pose: Pose


@dataclass(frozen=True)
class Explanation:
    """A candidate settled on the image. pose: where it came to rest, in the frame of `observation`, which is mirrored
    or inverted where the candidate's is. score: correlation of the coarse search. likeness: see
    `tasks.compare.likeness`, without the map's markings; markings: see `markings_at`, None without a map. size: width
    of the disk by the predicted one. limb_px, limb_share: robust RMS of the limb's shifts, and the part of the lit
    segments that was measured. in_frame: part of the disk in the frame. fault: why it did not come to rest, None when
    it did."""

    candidate: Candidate
    pose: Pose
    score: float
    likeness: float
    markings: float | None
    size: float
    limb_px: float | None
    limb_share: float
    in_frame: float
    fault: str | None

    def told(self, scene: Scene) -> dict[str, Any]:
        """As JSON values."""
        found = {key: getattr(self, key) for key in ("score", "likeness", "markings", "size", "limb_px", "limb_share")}
        return {
            "tried": self.candidate.name,
            "detail": self.candidate.detail,
            "centre_px": scene.camera.project(self.pose.target_in_camera_km).tolist(),
            "radius_px": disk_radius_px(self.pose, scene.camera, scene.target),
            "sun_azimuth_deg": sun_azimuth_deg(self.pose),
            "phase_deg": self.pose.phase_deg,
            **found,
            "in_frame": self.in_frame,
            "fault": self.fault,
        }


def tried(
    observation: Observation, pose: Pose, scene: Scene, settings: DiagnoseSettings, progress: Progress | None = None
) -> list[Explanation]:
    """The best explanation of each family, the predicted one first. pose: the target in front of the camera."""
    plain = replace(scene, basemap=uniform_map())
    rough = replace(plain, settings=plain.settings.model_copy(update={"oversample": SEARCH_OVERSAMPLE}))
    seen = [
        best for family in families(observation, pose, plain, settings) if (best := best_of(family, rough, settings))
    ]
    worth = max([find.score for _, find in seen], default=0.0) - settings.worth
    found = []
    for number, (candidate, find) in enumerate(seen, 1):
        if progress:
            progress("diagnose", number, f"{candidate.name}: {find.score:.2f}")
        if candidate.name == "as-predicted" or find.score >= max(worth, settings.least_score):
            found.append(settled(candidate, find, pose, plain, scene, settings))
    return found


def families(
    observation: Observation, pose: Pose, scene: Scene, settings: DiagnoseSettings
) -> Iterator[list[Candidate]]:
    """Candidates, by what they change; the predicted pose first."""
    yield [Candidate("as-predicted", 1.0, observation, pose)]
    others = without_others(observation, pose, scene)
    if others:
        yield [Candidate("other-body", 1.0, others.observation, pose)]
    yield [Candidate("size", size, observation, pose.with_range_factor(1 / size)) for size in settings.sizes]
    azimuths = sun_azimuth_deg(pose) + 360 * np.arange(settings.azimuths) / settings.azimuths
    phases = (pose.phase_deg, *settings.phases_deg)
    suns = [(azimuth, phase) for phase in phases for azimuth in azimuths]
    yield [Candidate("sun", azimuth, observation, with_sun(pose, azimuth, phase)) for azimuth, phase in suns[1:]]
    yield [Candidate("mirrored", 1.0, mirrored(observation), pose)]
    for turn_deg in (90.0, 180.0, 270.0):
        yield [Candidate("rolled", turn_deg, observation, rolled(pose, turn_deg))]
    yield [Candidate("inverted", 1.0, replace(observation, image=-observation.image), pose)]


def mirrored(observation: Observation) -> Observation:
    """Left and right exchanged."""
    image, noise, quality = observation.image, observation.noise, observation.quality
    return Observation(image[:, ::-1].copy(), noise[:, ::-1].copy(), quality[:, ::-1].copy())


def best_of(family: list[Candidate], scene: Scene, settings: DiagnoseSettings) -> tuple[Candidate, CoarseFind] | None:
    """The candidate that the frame shows best, and where; None when none of them can be looked for."""
    found = []
    for candidate in family:
        radius = disk_radius_px(candidate.pose, scene.camera, scene.target)
        if not 4 <= radius <= 2 * np.hypot(*scene.camera.size_px):
            continue
        step = max(reduction_for(candidate.pose, scene, settings.diameter_px), frame_step(scene, radius, settings))
        found.append(
            (candidate, find_target(candidate.observation, candidate.pose, scene, MIN_OVERLAP, step, settings.clip_at))
        )
    return max(found, key=lambda pair: pair[1].score, default=None)


def frame_step(scene: Scene, radius_px: float, settings: DiagnoseSettings) -> int:
    """Cells that the frame is searched in: so large that it has few, as long as the disk has some."""
    enough = max(scene.camera.size_px) / settings.frame_px
    return max(1, int(min(enough, radius_px / 4)))


def settled(
    candidate: Candidate,
    found: CoarseFind,
    predicted: Pose,
    plain: Scene,
    scene: Scene,
    settings: DiagnoseSettings,
) -> Explanation:
    """The candidate brought to rest on the limb, and how well it then explains the image."""
    n = reduction_for(found.pose, scene, settings.settle_px)
    observation, plain, scene = (
        reduced_observation(candidate.observation, n),
        reduced_scene(plain, n),
        reduced_scene(scene, n),
    )
    pose, fault = found.pose, None
    coarse = plain.coarser(pose, ACROSS)
    try:
        pose = find_range_by_limb(observation, pose, coarse, SETTLING).pose
    except FailedError as error:
        fault = error.fault
    report = validate_limb(observation, pose, coarse, VALIDATE)
    radius, expected = (disk_radius_px(p, scene.camera, scene.target) for p in (pose, predicted))
    return Explanation(
        candidate,
        pose,
        found.score,
        likeness_at(observation, pose, coarse),
        markings_at(observation, pose, replace(coarse, basemap=scene.basemap)),
        radius / expected,
        None if report.robust_px is None else n * report.robust_px,
        report.points / report.tried if report.tried else 0.0,
        share_in_frame(pose, scene),
        fault,
    )


def markings_at(observation: Observation, pose: Pose, scene: Scene) -> float | None:
    """Correlation (-1..1) of what image and map show inside the lit disk beyond outline and shading; None without a
    map, or where too little of the disk is seen. A turn by some degrees lowers it, another face or a mirrored one
    leaves nothing."""
    if np.ptp(scene.basemap.albedo) == 0:
        return None
    match = with_rim(observation, pose, scene)
    simulation = match.simulation
    inside = match.usable & (simulation.coverage > 0.99) & (simulation.lit > 0.99)
    if np.count_nonzero(inside) < FEWEST_PIXELS:
        return None
    weight = np.where(inside, match.weight, 0).astype(np.float32)
    columns = brightness_columns(simulation.shading)
    left = []
    for picture in (match.image, simulation.image()):
        values, _, _ = robust_least_squares(columns, picture, weight)
        left.append(picture - np.tensordot(values, columns, 1))
    return correlation(left[0], left[1], inside)
