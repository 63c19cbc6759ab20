"""Point: register image and simulation, turn the camera, render again, until nothing moves (paper, figure 5)."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from catalog.errors import FailedError, RefusedError
from catalog.observation import Observation, Quality
from catalog.pose import Pose
from catalog.reasons import Reason
from tasks.bodies.masks import alone
from tasks.compare.likeness import likeness, with_rim
from tasks.compare.match import match_scene
from tasks.compare.reduce import reduced_observation, reduced_scene, reduction_for
from tasks.correction import FORMAL, Correction
from tasks.point.coarse import CoarseFind, find_target
from tasks.point.in_front import find_in_front
from tasks.point.registration import RegistrationName, Shift, find_registration
from tasks.point.rotation import pose_moved_by
from tasks.point.with_others import find_with_others, is_before_another
from tasks.rest import REST_PX, Rest, rest_of
from tasks.simulate import Scene
from tasks.simulate.window import disk_radius_px
from tasks.undistort.saturation import areas, with_plate_flagged

Progress = Callable[[str, int, str], None]

SMALLEST_PLATEAU_PX = 100
# A disk of which more of the bright pixels are saturated is refused; with 63 % the rest still tells.
SATURATED_SHARE = 0.75
# An arc of limb may be in a frame that the pose's disk misses by so much of its radius.
NEAR_SHARE = 0.05


class PointSettings(BaseModel):
    """coarse: search the whole frame first. diameter_px: larger disks are settled at reduced resolution.
    stop_px: a smaller move ends the loop. rest_px: so does going to and fro within so much of the middle of the way, or
    within the registration's own error; the middle is then taken, and the scatter added to the uncertainty.
    min_overlap: part of the disk that must be in the frame; arc_overlap: the same where the pose that is corrected has
    less than min_overlap of it in the frame or next to it.
    min_score, min_correlation: below these the target counts as not found. rival_likeness: where the
    target fits elsewhere in the frame, too, with this correlation or more, the place is in doubt (measured on disks
    0.8-1.3 times as wide as the target's: 0.90-0.99)."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    registration: RegistrationName = "least-squares"
    coarse: bool = True
    diameter_px: float = Field(300.0, gt=0)
    stop_px: float = Field(0.02, gt=0)
    rest_px: float = Field(REST_PX, ge=0)
    max_iterations: int = Field(12, ge=1, le=100)
    min_overlap: float = Field(0.25, gt=0, le=1)
    arc_overlap: float = Field(0.002, gt=0, le=1)
    min_score: float = Field(0.4, ge=-1, le=1)
    min_correlation: float = Field(0.6, ge=-1, le=1)
    rival_likeness: float = Field(0.85, ge=0, le=1)


def refuse_without_limb(pose: Pose, scene: Scene) -> None:
    """Raise RefusedError when the target is too large for enough of its limb to be in the frame, or too small to
    register."""
    radius = disk_radius_px(pose, scene.camera, scene.target)
    diagonal = float(np.hypot(*scene.camera.size_px))
    if radius > 2 * diagonal:
        raise RefusedError(
            Reason.NO_LIMB,
            f"the disk of {scene.target.name} is {2 * radius:.0f} px wide and the frame {scene.camera.size_px[0]} px: "
            f"at most {np.degrees(diagonal / radius):.0f} deg of its limb can be in it, too short and straight a piece "
            "to fix the pose.",
            "Choose a frame that was taken from farther away, or check the range.",
        )
    if radius < 4:
        raise RefusedError(
            Reason.DISK_TOO_SMALL,
            f"the disk of {scene.target.name} is only {2 * radius:.1f} px wide.",
            "It must be resolved (at least 8 px); check the range and the camera.",
        )


def refuse_saturated(observation: Observation) -> None:
    """Raise RefusedError when nearly all that is bright is saturated, flagged or not: a disk clipped to a white plate
    would be fitted with a wrong size. Hot pixels, bright columns and stars are no part of a disk, see
    `saturation.areas`."""
    flagged = with_plate_flagged(observation)
    plate = areas((flagged.quality & np.uint16(Quality.SATURATED)) != 0)
    saturated, usable = int(np.count_nonzero(plate)), flagged.usable
    if saturated <= SMALLEST_PLATEAU_PX or not usable.any():
        return
    value, low = float(np.median(observation.image[plate])), float(np.percentile(observation.image[usable], 1))
    bright = int(np.count_nonzero(areas(plate | (usable & (observation.image > (low + value) / 2)))))
    if saturated > SATURATED_SHARE * bright:
        raise RefusedError(
            Reason.SATURATED,
            f"the disk is saturated: {saturated} of its {bright} bright pixels are clipped at the value {value:g}.",
            "Choose a shorter exposure.",
        )


def find_pointing(
    observation: Observation, pose: Pose, scene: Scene, settings: PointSettings, progress: Progress | None = None
) -> Correction:
    """Correct the camera's pointing; the target's range and attitude stay. Where the pose itself has but a small part
    of the disk in the frame, so small a part is looked for, too, if no larger one is found.

    Raises RefusedError when no limb can be in the frame, the disk is saturated or not found, FailedError when the loop
    does not settle within `max_iterations` (the message carries the history).
    """
    refuse_without_limb(pose, scene)
    try:
        return found_pointing(observation, pose, scene, settings, progress)
    except RefusedError as error:
        is_arc = 0 < share_in_frame(pose, scene, NEAR_SHARE) < settings.min_overlap
        if error.code != Reason.TARGET_NOT_FOUND or not is_arc:
            raise
    smaller = settings.model_copy(update={"min_overlap": settings.arc_overlap})
    return found_pointing(observation, pose, scene, smaller, progress)


def found_pointing(
    observation: Observation, pose: Pose, scene: Scene, settings: PointSettings, progress: Progress | None
) -> Correction:
    """`find_pointing` of a target of which at least the settings' min_overlap is in the frame."""
    evidence: dict[str, Any] = {}
    start, rival = pose, None
    everything = observation
    if not has_others(pose, scene):
        refuse_saturated(observation)
    if settings.coarse:
        found = searched(observation, pose, scene, settings.min_overlap)
        evidence["coarse"] = {"score": found.score, "step_px": found.step_px}
        if not found.score >= settings.min_score:
            raise RefusedError(
                Reason.TARGET_NOT_FOUND,
                f"nothing in the frame looks like {scene.target.name} (best correlation {found.score:.2f}, "
                f"needed {settings.min_score}).",
                "Check target, range, Sun direction and base map; an empty, saturated or cut-off frame gives this too.",
            )
        start, rival = found.pose, found.next_best
        if progress:
            progress("point", 0, f"coarse search: correlation {found.score:.3f}")
    observation = alone(everything, start, scene, 0.0 if start is pose else evidence["coarse"]["step_px"])
    # The limb's edges want all their pixels.
    n = 1 if settings.registration == "limb" else reduction_for(start, scene, settings.diameter_px)
    evidence["reduction"] = n
    settled, shift, history, rest = settle(
        reduced_observation(observation, n), start, reduced_scene(scene, n), settings, progress
    )
    observation = alone(everything, settled, scene)
    if has_others(settled, scene):
        refuse_saturated(observation)
    share = share_in_frame(settled, scene)
    if share < settings.min_overlap:
        raise RefusedError(
            Reason.TARGET_NOT_FOUND,
            f"the disk of {scene.target.name} fits best where only {100 * share:.2g}% of it would be in the frame "
            f"(needed {100 * settings.min_overlap:.2g}%).",
            "Check target, range and Sun direction; a frame without the target or its limb gives this too.",
        )
    alike = likeness_at(observation, settled, scene)
    if not min(shift.quality, alike) >= settings.min_correlation:
        raise RefusedError(
            Reason.TARGET_NOT_FOUND,
            f"image and simulation of {scene.target.name} correlate by only {min(shift.quality, alike):.2f} "
            f"(needed {settings.min_correlation}; negative: the target would be darker than the sky).",
            "Check target, range, Sun direction and base map.",
        )
    if rival is not None and (doubt := doubt_of_rival(observation, settled, rival, alike, scene, settings)):
        evidence["doubt"] = doubt
    offset = scene.camera.project(settled.target_in_camera_km) - predicted_centre(pose, scene)
    if rest is not None:
        evidence["scatter_px"] = (n * rest.scatter).tolist()
    return Correction(
        step="point",
        pose=settled,
        changed={"offset_px": offset.tolist()},
        # Errors of map, law and range move the best match by 40 times its formal error (docs/method/point.md).
        uncertainty={"offset_px": None},
        evidence=evidence
        | {"history_px": history, "correlation": shift.quality, "likeness": alike}
        | {FORMAL: {"offset_px": sigma_px(shift, rest, n)}},
    )


def searched(observation: Observation, pose: Pose, scene: Scene, min_overlap: float) -> CoarseFind:
    """Where the target is, to about a cell of the search grid: by all bodies of the frame where the pose knows others;
    else in front of the sky or, where the frame holds a large bright body, in front of that, whichever is more like
    the image."""
    by_all = find_with_others(observation, pose, scene, min_overlap)
    if by_all is not None and not any(is_before_another(each, scene) for each in (by_all.pose, pose)):
        return by_all
    found = find_target(observation, pose, scene, min_overlap)
    in_front = find_in_front(observation, pose, scene, min_overlap)
    finds = [each for each in (found, in_front, by_all) if each is not None]
    if len(finds) == 1:
        return found
    return max(finds, key=lambda find: likeness_beside_others(observation, find.pose, scene))


def likeness_beside_others(observation: Observation, pose: Pose, scene: Scene) -> float:
    """`likeness_at` with other bodies left out; -1 where nothing of the target is left then."""
    try:
        return likeness_at(alone(observation, pose, scene), pose, scene)
    except FailedError:
        return -1.0


def has_others(pose: Pose, scene: Scene) -> bool:
    """Whether the pose knows other bodies or rings, which may be the brightest of the frame."""
    return bool(pose.bodies or scene.target.rings)


def doubt_of_rival(
    observation: Observation, found: Pose, rival: Pose, alike: float, scene: Scene, settings: PointSettings
) -> str | None:
    """The doubt that another place raises where the target fits nearly as well, now that it is known what is where it
    was found. alike: likeness there. A place where too little of the disk would be in the frame is none, as for the
    target itself."""
    if share_in_frame(rival, scene) < settings.min_overlap:
        return None
    try:
        there = likeness_at(without_disk(observation, found, scene), rival, scene)
    except FailedError:  # nothing usable is left there
        return None
    if there < settings.rival_likeness:
        return None
    x, y = predicted_centre(rival, scene)
    return (
        f"{Reason.FITS_ELSEWHERE}: {scene.target.name} fits nearly as well at ({x:.0f}, {y:.0f}): image and simulation "
        f"correlate by {there:.2f} there and by {alike:.2f} where it was found. Mask what is another body (--mask), or "
        "say where the target is (--start-offset)."
    )


def without_disk(observation: Observation, pose: Pose, scene: Scene) -> Observation:
    """The observation with the target's disk masked, and what its blur reaches."""
    x, y = predicted_centre(pose, scene)
    reach = disk_radius_px(pose, scene.camera, scene.target) + 4 * max(scene.camera.psf_sigma_px, 1.0)
    rows, columns = np.indices(observation.image.shape)
    covered = np.hypot(columns - x, rows - y) < reach
    quality = np.where(covered, observation.quality | np.uint16(Quality.MASKED_BY_USER), observation.quality)
    return replace(observation, quality=quality.astype(np.uint16))


def sigma_px(shift: Shift, rest: Rest | None, n: int) -> list[float] | None:
    """1-sigma of the offset (2,) in pixels of the image, n times those of the loop; None where nothing tells it."""
    if shift.covariance is None and rest is None:
        return None
    own = np.zeros(2) if shift.covariance is None else np.diag(shift.covariance)
    scatter = np.zeros(2) if rest is None else rest.scatter
    return (n * np.sqrt(own + scatter**2)).tolist()


def share_in_frame(pose: Pose, scene: Scene, near: float = 0.0) -> float:
    """Part of the target's disk that lies in the frame. near: of a disk larger by this share."""
    centre, size = scene.camera.project(pose.target_in_camera_km), np.array(scene.camera.size_px)
    steps = np.linspace(-1, 1, 41)
    across = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    xy = centre + (1 + near) * disk_radius_px(pose, scene.camera, scene.target) * across[np.hypot(*across.T) <= 1]
    return float(((xy > -0.5) & (xy < size - 0.5)).all(axis=1).mean())


def likeness_at(observation: Observation, pose: Pose, scene: Scene) -> float:
    """How like the image the simulation of `pose` is, by a measure that no registration works on (see `likeness`)."""
    return likeness(with_rim(observation, pose, scene))


def predicted_centre(pose: Pose, scene: Scene) -> np.ndarray:
    """Pixel (2,) of the target's centre; NaN when it is behind the camera."""
    return scene.camera.project(pose.target_in_camera_km)


def settle(
    observation: Observation, pose: Pose, scene: Scene, settings: PointSettings, progress: Progress | None
) -> tuple[Pose, Shift, list[list[float]], Rest | None]:
    """The loop of figure 5: settled pose, the last shift, all shifts, and where it stands still if it still moves."""
    register = find_registration(settings.registration)
    history: list[list[float]] = []
    for iteration in range(1, settings.max_iterations + 1):
        shift = register(match_scene(observation, scene, pose))
        history.append(shift.offset_px.tolist())
        pose = pose_moved_by(pose, scene.camera, shift.offset_px)
        length = float(np.hypot(*shift.offset_px))
        if progress:
            progress("point", iteration, f"moved {length:.3f} px")
        if length < settings.stop_px:
            return pose, shift, history, None
        own = 0.0 if shift.covariance is None else float(np.sqrt(np.trace(shift.covariance)))
        rest = rest_of(history, max(settings.rest_px, own))
        if rest is not None:
            return pose_moved_by(pose, scene.camera, rest.back), shift, history, rest
    raise FailedError(
        Reason.DID_NOT_CONVERGE,
        f"pointing did not converge in {settings.max_iterations} iterations; moves were "
        + ", ".join(f"{np.hypot(move[0], move[1]):.3f}" for move in history)
        + " px.",
        "Check range and Sun direction, or try another registration.",
    )
