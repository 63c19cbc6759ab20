"""The iteration of the joint step: how long a step may be, when it is at rest, and what it is given."""

from dataclasses import replace

import numpy as np
import pytest

from catalog.errors import FailedError
from catalog.observation import Observation
from catalog.rotation import rotation_from_vector_deg
from lab.simulate.plant import planted
from lab.simulate.small_world import EUROPA, observation_of, scene_of, small_camera, true_pose
from tasks.compare.match import framed_window
from tasks.joint import JointSettings
from tasks.joint.blur import SecondMoment
from tasks.joint.coarse_to_fine import prior_sigmas
from tasks.joint.cutout import Cutout
from tasks.joint.gauss_newton import Line, aitken, bearable, solve_joint, still, tiles_at
from tasks.joint.model import Model, axes_across, linear_model
from tasks.joint.parameters import NAMES, OFFSET, PSF, RANGE, State, difference, with_psf_within
from tasks.joint.problem import Problem
from tasks.joint.surface import fine_surface
from tasks.joint.tiles import layout_for
from tasks.simulate.suns import with_sun
from tasks.simulate.window import Window, disk_radius_px

SETTINGS = JointSettings(second_start=False, oversample=2)
LIMITS = SETTINGS.thresholds.iteration
CAMERA = small_camera(60.0, (90, 88)).model_copy(update={"centre_px": (44.5, 43.5)})
TRUTH = true_pose(CAMERA)
SCENE = scene_of(CAMERA, "mixture")


@pytest.fixture(scope="module")
def given() -> Problem:
    start = State(TRUTH, CAMERA.psf_sigma_px)
    return Problem(
        observation_of(scene_of(CAMERA), TRUTH), SCENE, start, prior_sigmas(SETTINGS.priors.file, 1e6), SETTINGS
    )


def test_a_step_is_shortened_to_what_the_linearisation_bears() -> None:
    step = np.zeros(8)
    step[OFFSET] = 6.0, 8.0
    none = np.zeros(0)
    assert bearable(step, none, LIMITS, 30.0) == pytest.approx(LIMITS.largest_limb_px / 10)
    assert bearable(0.1 * step, none, LIMITS, 30.0) == 1.0
    step[:] = 0
    step[RANGE] = 0.2
    assert bearable(step, none, LIMITS, 30.0) == pytest.approx(LIMITS.largest_limb_px / 6)
    assert bearable(np.zeros(8), np.array([3.0, 0.0]), LIMITS, 30.0) == pytest.approx(0.5)


def test_each_unknown_has_a_step_that_need_not_be_taken() -> None:
    assert still(LIMITS).shape == (len(NAMES),)
    assert (still(LIMITS) > 0).all()


def test_a_planted_error_is_taken_back_and_a_held_one_stays(given: Problem) -> None:
    start = State(planted(TRUTH, CAMERA, (1.2, -0.8), 1.003, (0, 0, 0)), CAMERA.psf_sigma_px)
    found = solve_joint(given, start)
    left = difference(found.state, given.metadata, CAMERA)
    print(f"{len(found.history)} steps; left {np.round(left, 4)}")
    assert np.hypot(*left[OFFSET]) < 0.1
    assert found.converged
    held = solve_joint(given.with_settings(hold=("range", "attitude", "roll")), start)
    assert difference(held.state, start, CAMERA)[RANGE] == pytest.approx(0, abs=1e-12)
    assert held.given.held.tolist() == [False, False, True, True, True, True, True, False]


def test_the_cost_is_least_where_the_solution_is(given: Problem) -> None:
    found = solve_joint(given.with_free_range(), State(TRUTH, CAMERA.psf_sigma_px))
    line = Line.of(found, found.given)
    here = line.cost_at(found, found.state)
    for unknown, step in ((0, 0.5), (1, -0.5), (RANGE, 0.01)):
        away = np.zeros(8)
        away[unknown] = step
        assert line.cost_at(found, found.state.moved(away, CAMERA)) > here


def test_an_image_without_usable_pixels_fails_with_its_reason(given: Problem) -> None:
    seen = given.observation
    nothing = Observation(np.full_like(seen.image, np.nan), seen.noise, seen.quality)
    with pytest.raises(FailedError) as failure:
        solve_joint(replace(given, observation=nothing), given.metadata)
    assert failure.value.code == "no-usable-pixels"


def test_pixels_outside_the_frame_or_unknown_are_not_usable(given: Problem) -> None:
    image = given.observation.image.copy()
    image[10, 12] = np.nan
    cut = Cutout(replace(given.observation, image=image), Window(-5, -3, 40, 30))
    assert cut.image.shape == cut.usable.shape == (33, 45)
    assert not cut.usable[:3].any()
    assert not cut.usable[:, :5].any()
    assert not cut.usable[13, 17]
    assert cut.image[13, 17] == 0
    assert np.isfinite(cut.variance).all()
    assert cut.hidden_share == (1.0, 0.0)


def test_the_surface_under_the_sub_pixels_is_that_of_the_ellipsoid() -> None:
    """Cover by the area of the disk, cosines by plain geometry at the middle of the disk."""
    window = framed_window(SCENE, TRUTH)
    surface = fine_surface(SCENE, TRUTH, window, 3)
    area = surface.cover.sum() / 9
    assert area == pytest.approx(np.pi * disk_radius_px(TRUTH, CAMERA, EUROPA) ** 2, rel=2e-3)
    x, y = CAMERA.project(TRUTH.target_in_camera_km) - (window.x0, window.y0)
    at = (round((y + 0.5) * 3), round((x + 0.5) * 3))
    assert surface.mu[at] == pytest.approx(1.0, abs=2e-3)
    assert surface.mu0[at] == pytest.approx(np.cos(np.radians(TRUTH.phase_deg)), abs=0.03)
    lit = surface.mu0 > 0
    assert np.median(surface.albedo[lit]) == pytest.approx(np.median(SCENE.basemap.albedo), rel=0.3)
    assert not surface.albedo[~lit].any()


@pytest.mark.parametrize("unknown", range(8), ids=NAMES)
def test_the_model_changes_as_its_derivatives_say(given: Problem, unknown: int) -> None:
    """Central differences of two renderings."""
    start, window = given.metadata, framed_window(SCENE, TRUTH)
    radius = disk_radius_px(TRUTH, CAMERA, EUROPA)
    tiles = tiles_at(start, SCENE, window, layout_for(radius, SETTINGS.tiles))
    fine = SETTINGS.model_copy(update={"oversample": 5})

    def model_at(state: State) -> Model:
        return linear_model(replace(given, settings=fine), state, window, tiles)

    here = model_at(start)
    weights = np.linspace(1.0, 0.4, len(here.bases))
    column = here.derivatives(weights, np.zeros(window.shape, np.float32))[unknown]
    step = np.zeros(8)
    step[unknown] = (0.2, 0.2, 0.005, 0.5, 0.5, 0.5, 0.5, 0.05)[unknown]
    more, less = (model_at(start.moved(sign * step, CAMERA)).picture(weights) for sign in (1, -1))
    change = (more - less) / (2 * step[unknown])
    slope = float((column * change).sum() / (change**2).sum())
    left = float(np.linalg.norm(column - change) / np.linalg.norm(change))
    print(f"{NAMES[unknown]}: slope {slope:.3f}, {left:.3f} of it otherwise")
    assert slope == pytest.approx(1, abs=0.06)
    assert left < 0.35  # a difference over half a degree sees coarser markings than the derivative


@pytest.mark.parametrize("phase_deg", [5.0, 40.0, 100.0])
def test_the_model_changes_with_the_sun_as_its_columns_say(given: Problem, phase_deg: float) -> None:
    """Central differences of two renderings, the Sun turned about each of the two axes across its direction."""
    pose = with_sun(TRUTH, 30.0, phase_deg)
    start, window = State(pose, CAMERA.psf_sigma_px), framed_window(SCENE, pose)
    tiles = tiles_at(start, SCENE, window, layout_for(disk_radius_px(pose, CAMERA, EUROPA), SETTINGS.tiles))

    def model_at(state: State, sun_deg: float = 0.0) -> Model:
        return linear_model(replace(given, sun_deg=sun_deg), state, window, tiles)

    here = model_at(start, 2.0)
    weights = np.linspace(1.0, 0.4, len(here.bases))
    columns = here.turned_sun(weights)
    for column, axis in zip(columns, axes_across(pose.sun_from_target_km), strict=True):
        suns = [rotation_from_vector_deg(turn * axis) @ pose.sun_from_target_km for turn in (1.0, -1.0)]
        more, less = (model_at(replace(start, pose=pose.replaced(sun_from_target_km=sun))) for sun in suns)
        change = (more.picture(weights) - less.picture(weights)) / 2
        left = float(np.linalg.norm(column - change) / np.linalg.norm(change))
        print(f"phase {phase_deg:.0f}: {left:.3f} of it otherwise")
        assert left < 0.2
    there = model_at(start)
    assert len(there.turned_sun(weights)) == 0
    counts = [len(model.columns(weights, model.brightness(weights))) for model in (here, there)]
    assert counts[0] == counts[1] + 2


@pytest.mark.parametrize(
    ("turn_deg", "phase_deg"), [((1.5, 0.0, 0.0), 60.0), ((0.0, -1.5, 0.0), 60.0), ((0.0, 1.0, 1.0), 25.0)]
)
def test_a_wrong_sun_moves_the_centre_less_where_its_error_is_known(
    given: Problem, turn_deg: tuple[float, float, float], phase_deg: float
) -> None:
    """Turned about axes of the camera: its direction is as far off as that of a pose found in the image."""
    pose = with_sun(TRUTH, 30.0, phase_deg)
    turn = pose.camera_from_j2000.T @ rotation_from_vector_deg(np.array(turn_deg)) @ pose.camera_from_j2000
    wrong = State(pose.replaced(sun_from_target_km=turn @ pose.sun_from_target_km), CAMERA.psf_sigma_px)
    seen = replace(given, observation=observation_of(scene_of(CAMERA), pose), metadata=wrong)
    away = [
        float(np.hypot(*difference(solve_joint(replace(seen, sun_deg=sun_deg), wrong).state, wrong, CAMERA)[OFFSET]))
        for sun_deg in (0.0, 2.0)
    ]
    print(f"{away[0]:.3f} px off, {away[1]:.3f} with its error known")
    assert away[1] < 0.6 * away[0]


@pytest.mark.parametrize(("length_px", "angle_deg"), [(2.0, 0.0), (3.0, 30.0), (1.5, 120.0)])
def test_a_trail_is_that_of_its_second_moment(length_px: float, angle_deg: float) -> None:
    angle = np.radians(angle_deg)
    moment = SecondMoment(length_px**2 / 12 * np.array([np.cos(2 * angle), np.sin(2 * angle)]), 0.01 * np.eye(2))
    x, y = moment.trail_px
    assert np.hypot(x, y) == pytest.approx(length_px)
    assert np.degrees(np.arctan2(y, x)) % 180 == pytest.approx(angle_deg, abs=1e-6)
    assert moment.significance == pytest.approx(length_px**2 / 12 / 0.1)


@pytest.mark.parametrize("change", [-13.0, -0.1, 0.0, 0.3, 13.0])
def test_an_update_by_correlation_leaves_the_psf_near_its_width(change: float) -> None:
    step = np.arange(1.0, 1.0 + len(NAMES)) * 1e-3
    step[PSF] = change
    bounded = with_psf_within(step, LIMITS.largest_psf)
    start = State(TRUTH, 0.8)
    widened = start.moved(bounded, CAMERA).psf_sigma_px / start.psf_sigma_px
    assert np.exp(-LIMITS.largest_psf) * 0.999 <= widened <= np.exp(LIMITS.largest_psf) * 1.001
    assert (np.delete(bounded, PSF) == np.delete(step, PSF)).all()
    if abs(change) <= LIMITS.largest_psf:
        assert bounded[PSF] == change


@pytest.mark.parametrize("ratio", [0.7, 0.88, 0.93])
def test_even_steps_are_taken_to_where_they_lead(ratio: float) -> None:
    step = np.array([0.3, -1.0, 0.0])
    assert aitken(ratio * step, step, LIMITS) * ratio == pytest.approx(ratio / (1 - ratio))
    assert aitken(0.3 * step, step, LIMITS) == 1  # converges by itself
    assert aitken(0.99 * step, step, LIMITS) == 1  # leads nowhere in sight
    assert aitken(-ratio * step, step, LIMITS) == 1  # to and fro
    assert aitken(ratio * step[::-1], step, LIMITS) == 1
    assert aitken(step, np.zeros(3), LIMITS) == 1
