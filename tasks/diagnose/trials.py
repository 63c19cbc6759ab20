"""What is tried where an image has no corrected pose: each explanation changes one thing, and is fitted to the limb.

The base map's markings are left out: outline and shading tell where the target is, how large, and how it is lit. Each
family of explanations is searched over the whole frame at low resolution; its best one is then settled by the limb.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.basemap import uniform_map
from catalog.errors import FailedError, PlanetposeError
from catalog.flips import PLACES
from catalog.observation import Observation
from catalog.pose import Pose
from catalog.reasons import Reason
from tasks.compare.brightness import brightness_columns, correlation, robust_least_squares
from tasks.compare.likeness import with_rim
from tasks.compare.reduce import reduced_observation, reduced_scene, reduction_for
from tasks.diagnose.candidates import Candidate, families
from tasks.diagnose.evidence import BLOCKS_ACROSS, Fit, better_by, fit_of, shared
from tasks.diagnose.settings import DiagnoseSettings
from tasks.point.coarse import CoarseFind, find_target
from tasks.point.loop import PointSettings, likeness_at, settle, share_in_frame
from tasks.point.rotation import pose_pointed_at
from tasks.range.limb import LimbRangeSettings, find_range_by_limb
from tasks.simulate import Scene
from tasks.simulate.suns import sun_azimuth_deg, with_sun_moved
from tasks.simulate.window import disk_radius_px
from tasks.validate.limb import ValidateSettings, validate_limb
from tasks.validate.sun import sun_in_image

Array = NDArray[np.float64]
Progress = Callable[[str, int, str], None]
MIN_OVERLAP = 0.25
REFINING = LimbRangeSettings(stop_px=0.5, max_iterations=12, limit=0.3, across=200)
# Each explanation changes one thing: where that is not the size, the disk may grow by no more than metadata err.
REFINING_AT_SIZE = REFINING.model_copy(update={"limit": 0.1})
SIZED = ("as-predicted", "size")
REGISTERING = PointSettings(coarse=False, stop_px=0.3)
VALIDATE = ValidateSettings()
# Sub-pixels across the disk of the renderings: the limb need only be right to a tenth of a pixel.
ACROSS = 300.0
SEARCH_OVERSAMPLE = 2
FEWEST_PIXELS = 100
# Cells of the frame in which explanations are compared: so many across the predicted disk.
COMPARED_PX = 60.0


@dataclass(frozen=True)
class Explanation:
    """A candidate settled on the image. pose: where it came to rest, in the frame of the candidate's `observation`.
    score: correlation of the coarse search. likeness: see `tasks.compare.likeness`, without the map's markings;
    markings, independent: see `markings_at`, None without a map. size: width of the disk by the predicted one. limb_px,
    limb_share: robust RMS of the limb's shifts, and the part of the lit segments that was measured. in_frame: part of
    the disk in the frame. fault: why it did not come to rest on the limb, None when it did. fit: what it leaves
    unexplained, None where nothing of it is on usable pixels."""

    candidate: Candidate
    pose: Pose
    score: float
    likeness: float
    markings: float | None
    independent: float
    size: float
    limb_px: float | None
    limb_share: float
    in_frame: float
    fault: str | None
    fit: Fit | None = field(repr=False)

    def to_dict(self, scene: Scene) -> dict[str, Any]:
        """As JSON values."""
        found = {key: getattr(self, key) for key in ("score", "likeness", "markings", "size", "limb_px", "limb_share")}
        return {
            "tried": self.candidate.name,
            "detail": self.candidate.detail,
            "flip": self.candidate.flip,
            "centre_px": scene.camera.project(self.pose.target_in_camera_km).tolist(),
            "radius_px": disk_radius_px(self.pose, scene.camera, scene.target),
            "sun_azimuth_deg": sun_azimuth_deg(self.pose),
            "phase_deg": self.pose.phase_deg,
            **found,
            "in_frame": self.in_frame,
            "fault": self.fault,
        }


@dataclass(frozen=True)
class Tried:
    """found: the best explanation of each family that is worth it, the predicted one first if it can be looked for.
    hypotheses: how many candidates were looked for in all. places: in how many places, disk by disk."""

    found: list[Explanation]
    hypotheses: int
    places: int


def tried(
    observation: Observation, pose: Pose, scene: Scene, settings: DiagnoseSettings, progress: Progress | None = None
) -> Tried:
    """The best explanation of each family. pose: the target in front of the camera."""
    plain = replace(scene, basemap=uniform_map())
    rough = replace(plain, settings=plain.settings.model_copy(update={"oversample": SEARCH_OVERSAMPLE}))
    all_families = list(families(observation, pose, plain, settings))
    seen = [best for family in all_families if (best := best_of(family, rough, settings))]
    worth = max([find.score for _, find in seen], default=0.0) - settings.worth
    compared = reduction_for(pose, scene, COMPARED_PX)
    found = []
    for number, (candidate, find) in enumerate(seen, 1):
        if progress:
            progress("diagnose", number, f"{candidate.name}: {find.score:.2f}")
        if candidate.name != "as-predicted" and find.score < max(worth, settings.least_score):
            continue
        try:
            found.append(refined(candidate, find, pose, plain, scene, settings, compared))
        except FailedError as error:  # where the image has no values, nothing is explained
            if error.code != Reason.NO_USABLE_PIXELS:
                raise
    found = with_same_starts(
        found, lambda start: refined(Candidate("as-predicted", 1.0, observation, start.pose), start, pose, plain, scene,
                                     settings, compared), scene,
    )  # fmt: skip
    radius = disk_radius_px(pose, scene.camera, scene.target)
    places = int(observation.image.size / max(np.pi * radius**2, 1.0)) + 1
    return Tried(found, sum(len(family) for family in all_families), places)


def with_same_starts(
    found: list[Explanation], as_it_is: Callable[[CoarseFind], Explanation], scene: Scene
) -> list[Explanation]:
    """What was found, the predicted one replaced where the picture as it is, settled by `as_it_is` from where a flipped
    one came to rest, leaves less unexplained: a search that was misled says nothing against the picture as it is."""
    first = next((e for e in found if e.candidate.name == "as-predicted"), None)
    for e in found:
        if e.candidate.flip is None or e.fit is None or not leaves_less(e, first):
            continue
        start = CoarseFind(pose_pointed_at(e.pose, scene.camera, place_unflipped(e, scene)), e.score, 1)
        try:
            again = as_it_is(start)
        except FailedError:  # of pixels without values nothing is said
            continue
        if again.fault is None and again.fit is not None and leaves_less(again, first):
            found = [again, *(other for other in found if other is not first)]
            first = again
    return found


def leaves_less(e: Explanation, other: Explanation | None) -> bool:
    """Whether one explanation leaves less of the image than another."""
    return other is None or other.fit is None or (e.fit is not None and better_by(e.fit, other.fit)[0] > 1)


def place_unflipped(e: Explanation, scene: Scene) -> Array:
    """Where the disk (2,) of a flipped picture is in the picture as it was taken; both are square, or of one shape."""
    middle = (np.array(scene.camera.size_px, dtype=np.float64) - 1) / 2
    place = scene.camera.project(e.pose.target_in_camera_km) - middle
    return np.asarray(middle + (place if e.candidate.flip is None else PLACES[e.candidate.flip].T @ place))


def best_of(family: list[Candidate], scene: Scene, settings: DiagnoseSettings) -> tuple[Candidate, CoarseFind] | None:
    """The candidate that the frame shows best, and where; None when none of them can be looked for."""
    found = []
    for candidate in family:
        radius = disk_radius_px(candidate.pose, scene.camera, scene.target)
        if not 4 <= radius <= 2 * np.hypot(*scene.camera.size_px):
            continue
        step = max(reduction_for(candidate.pose, scene, settings.diameter_px), frame_step(scene, radius, settings))
        seen = candidate.seen_by(scene)
        find = find_target(candidate.observation, candidate.pose, seen, MIN_OVERLAP, step, settings.clip_at)
        found.append((candidate, find))
    return max(found, key=lambda pair: pair[1].score, default=None)


def frame_step(scene: Scene, radius_px: float, settings: DiagnoseSettings) -> int:
    """Cells that the frame is searched in: so large that it has few, as long as the disk has some."""
    enough = max(scene.camera.size_px) / settings.frame_px
    return max(1, int(min(enough, radius_px / 4)))


def refined(
    candidate: Candidate,
    found: CoarseFind,
    predicted: Pose,
    plain: Scene,
    scene: Scene,
    settings: DiagnoseSettings,
    compared: int,
) -> Explanation:
    """The candidate brought to rest on the limb, and how well it then explains the image."""
    n = reduction_for(found.pose, scene, settings.settle_px)
    observation = reduced_observation(candidate.observation, n)
    small, mapped = reduced_scene(candidate.seen_by(plain), n), reduced_scene(candidate.seen_by(scene), n)
    coarse = small.coarser(found.pose, ACROSS)
    how = REFINING if candidate.name in SIZED else REFINING_AT_SIZE
    pose, fault = at_rest(observation, found.pose, coarse, how)
    if candidate.name == "sun" and fault is None:
        pose, fault = with_sun_of_image(observation, pose, coarse)
    report = validate_limb(observation, pose, coarse, VALIDATE)
    radius, expected = (disk_radius_px(p, scene.camera, scene.target) for p in (pose, predicted))
    markings, independent = markings_at(observation, pose, replace(coarse, basemap=mapped.basemap))
    return Explanation(
        candidate,
        pose,
        found.score,
        likeness_at(observation, pose, coarse),
        markings,
        independent,
        radius / expected,
        None if report.robust_px is None else n * report.robust_px,
        report.points / report.tried if report.tried else 0.0,
        share_in_frame(pose, scene),
        fault,
        fit_or_none(candidate, pose, plain, compared),
    )


def at_rest(
    observation: Observation, pose: Pose, scene: Scene, how: LimbRangeSettings = REFINING_AT_SIZE
) -> tuple[Pose, str | None]:
    """Centre and range by the limb; where it is not measured the centre by all pixels, and why."""
    try:
        return find_range_by_limb(observation, pose, scene, how).pose, None
    except FailedError as error:
        fault = error.fault
    try:
        return settle(observation, pose, scene, REGISTERING, None)[0], fault
    except PlanetposeError:
        return pose, fault


def with_sun_of_image(observation: Observation, pose: Pose, scene: Scene) -> tuple[Pose, str | None]:
    """The pose with the Sun where the shading has it, instead of at the nearest of those tried, and at rest on its
    limb; as it was where that does not settle."""
    sun = sun_in_image(observation, pose, scene)
    if sun.azimuth_deg is None or sun.phase_deg is None:
        return pose, None
    moved, fault = at_rest(observation, with_sun_moved(pose, sun.azimuth_deg, sun.phase_deg), scene)
    return (pose, None) if fault else (moved, None)


def fit_or_none(candidate: Candidate, pose: Pose, scene: Scene, n: int) -> Fit | None:
    """See `fit_of`."""
    try:
        return fit_of(candidate, candidate.observation, pose, scene, n)
    except FailedError:
        return None


def markings_at(observation: Observation, pose: Pose, scene: Scene) -> tuple[float | None, float]:
    """Correlation (-1..1) of what image and map show inside the lit disk beyond outline and shading, and the number of
    independent pixels that it rests on; None without a map, or where too little of the disk is seen. A turn by some
    degrees lowers it, another face or a mirrored one leaves nothing."""
    if np.ptp(scene.basemap.albedo) == 0:
        return None, 0.0
    match = with_rim(observation, pose, scene)
    simulation = match.simulation
    inside = match.usable & (simulation.coverage > 0.99) & (simulation.lit > 0.99)
    count = int(np.count_nonzero(inside))
    if count < FEWEST_PIXELS:
        return None, 0.0
    weight = np.where(inside, match.weight, 0).astype(np.float32)
    columns = brightness_columns(simulation.shading)
    left = []
    for picture in (match.image, simulation.image()):
        values, _, _ = robust_least_squares(columns, picture, weight)
        left.append(np.where(inside, picture - np.tensordot(values, columns, 1), 0))
    # Two smooth pictures agree by chance as far as their product's pixels go together.
    block_px = max(2, round(2 * disk_radius_px(pose, match.scene.camera, scene.target) / BLOCKS_ACROSS))
    independent = count / min(shared(each, block_px) for each in left)
    return correlation(left[0], left[1], inside), independent
