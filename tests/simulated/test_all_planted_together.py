"""Offset, range and attitude wrong at once: the passes of the flow settle on the truth."""

from types import SimpleNamespace

import numpy as np

from catalog.observation import Observation
from catalog.pose import Pose
from flows.image import settled
from lab.simulate.plant import PoseError, planted, pose_error
from lab.simulate.small_world import EUROPA, observation_of, scene_of, small_camera, true_pose
from tasks.attitude import AttitudeSettings, find_attitude
from tasks.correcting import recorded
from tasks.point import PointSettings, find_pointing
from tasks.profile import Profile, find_profile
from tasks.range import RangeSettings, find_range
from tasks.simulate import Scene
from tasks.validate import validate_limb

OFFSET_BAR_PX, RANGE_BAR, ATTITUDE_BAR_DEG = 0.05, 5e-4, 0.1
STEPS = {
    "point": (find_pointing, PointSettings),
    "range": (find_range, RangeSettings),
    "attitude": (find_attitude, AttitudeSettings),
}
PLANTED = {"offset_px": (20.32, -30.46), "range_factor": 0.995, "attitude_deg": (0.4, -0.6, np.sqrt(0.48))}
CAMERA = small_camera(diameter_px=130, size_px=(192, 184)).model_copy(update={"centre_px": (90.3, 98.6)})


def passes(observation: Observation, pose: Pose, truth: Pose, scene: Scene, profile: Profile) -> list[PoseError]:
    """What is left of the planted errors before and after every pass; as `flows.image.correct_image` runs them."""
    left = [pose_error(pose, truth, CAMERA, EUROPA)]
    chain = SimpleNamespace(request=SimpleNamespace(profile=profile), done={})
    for number in range(1, profile.passes + 1):
        for name in profile.corrections(number):
            step, model = STEPS[name]
            settings = profile.settings_of(name, number).model_dump()
            if name == "point" and number > 1:
                settings["coarse"] = False
            correction = step(observation, pose, scene, model.model_validate(settings))
            pose = correction.pose
            chain.done[f"{name}-{number}"] = SimpleNamespace(result=recorded(correction))
        left.append(pose_error(pose, truth, CAMERA, EUROPA))
        if number > 1 and settled(chain, number):  # type: ignore[arg-type]
            break
    limb = validate_limb(observation, pose, scene)
    print(f"limb rms {limb.rms_px:.3f} px of {limb.points} segments")
    return left


def table(left: list[PoseError]) -> str:
    lines = ["pass   centre px   range       attitude deg   surface px"]
    for number, error in enumerate(left):
        centre = np.hypot(*error.centre_px)
        lines.append(
            f"{number:4d} {centre:11.4f}   {error.range:+.6f} {error.attitude_deg:13.4f} {error.surface_px:12.4f}"
        )
    return "\n".join(lines)


def test_the_standard_profile_meets_the_bars_when_everything_is_wrong() -> None:
    profile = find_profile("standard")
    truth = true_pose(CAMERA, phase_deg=75.0, sun_azimuth_deg=330.0)
    observation = observation_of(scene_of(CAMERA), truth)
    scene = Scene(CAMERA, EUROPA, scene_of(CAMERA).basemap, profile.simulate)
    left = passes(observation, planted(truth, CAMERA, **PLANTED), truth, scene, profile)
    print(f"standard profile, bars {OFFSET_BAR_PX} px, {RANGE_BAR}, {ATTITUDE_BAR_DEG} deg")
    print(table(left))
    assert np.hypot(*left[-1].centre_px) < OFFSET_BAR_PX
    assert abs(left[-1].range) < RANGE_BAR
    assert left[-1].attitude_deg < ATTITUDE_BAR_DEG
    assert left[-1].surface_px < OFFSET_BAR_PX
    surface = [error.surface_px for error in left]
    assert surface[0] > 30
    assert surface[1] < 0.5
    assert surface[2] < 0.5 * surface[1]
    assert abs(surface[-1] - surface[-2]) < 0.02  # it has settled
