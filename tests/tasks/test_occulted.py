"""A target in front of a bright body: what it hides is part of the model, and dark surroundings change nothing."""

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from catalog.basemap import uniform_map
from catalog.errors import PlanetposeError
from catalog.observation import Observation, Quality
from catalog.pose import Pose
from lab.simulate.independent import independent_image
from lab.simulate.plant import planted, pose_error
from lab.simulate.small_world import NOISE_DN, PEAK_DN, SKY_DN, clean_image, observed, scene_of, small_camera, true_pose
from tasks.compare.brightness import fit_brightness
from tasks.compare.likeness import likeness, with_rim
from tasks.compare.limb_edges import LimbSettings, measure_limb
from tasks.compare.match import framed_window, match_scene
from tasks.compare.occulted import continued, light_behind
from tasks.joint import JointSettings, find_pose_jointly
from tasks.point import PointSettings, find_pointing
from tasks.point.in_front import evidence, hidden_scores

CAMERA = small_camera(diameter_px=60)
SCENE = scene_of(CAMERA, "mixture", oversample=3)
TRUTH = true_pose(CAMERA, (108.4, 101.7))
WRONG = planted(TRUTH, CAMERA, (21.3, -14.6), 1, (0, 0, 0))
SETTINGS = PointSettings(diameter_px=100, stop_px=0.1)
# Brightness of the planet, of the moon's.
RATIOS = (0.5, 1.0, 2.0)


def planet(ratio: float, edge_px: float = 1e9) -> NDArray[np.float64]:
    """A planet's brightness (ny, nx) that changes gently across the frame and ends at x = edge_px."""
    nx, ny = CAMERA.size_px
    y, x = np.mgrid[:ny, :nx]
    gentle = 1 - ((x - 80) / 500) ** 2 - ((y - 130) / 400) ** 2 + 0.02 * np.sin(y / 25)
    return np.asarray(ratio * 0.8 * PEAK_DN * gentle / (1 + np.exp(x - edge_px)))


@cache
def moon() -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """The moon's light, DN, and its coverage (ny, nx): at full phase a body of Lommel and Seeliger's law is even."""
    full = TRUTH.replaced(sun_from_target_km=-1000 * TRUTH.target_from_spacecraft_km)
    covered = independent_image(CAMERA, SCENE.target, full, {"lommel-seeliger": 1.0}, uniform_map())
    return clean_image(scene_of(CAMERA), TRUTH) - np.float32(SKY_DN), covered.astype(np.float32)


def in_front(ratio: float, edge_px: float = 1e9, seed: int = 1) -> Observation:
    """The moon in front of a planet."""
    light, covered = moon()
    return observed(SKY_DN + light + planet(ratio, edge_px) * (1 - covered), seed=seed)


def error_px(pose: Pose) -> float:
    return float(np.hypot(*pose_error(pose, TRUTH, CAMERA, SCENE.target).centre_px))


@settings(max_examples=30, deadline=None)
@given(st.floats(-3, 3), st.floats(-3, 3), st.floats(5, 18), st.floats(0.4, 0.6), st.floats(0.4, 0.6))
def test_a_slope_is_continued_over_a_hole_of_any_size(
    along: float, down: float, radius: float, at_x: float, at_y: float
) -> None:
    ny, nx = 61, 74
    y, x = np.mgrid[:ny, :nx]
    plane = (50 + along * x + down * y).astype(np.float32)
    hole = np.hypot(x - at_x * nx, y - at_y * ny) < radius
    filled = continued(np.where(hole, np.float32(-1e6), plane), ~hole)
    assert (filled[~hole] == plane[~hole]).all()
    reach = abs(along) + abs(down) + 0.1
    assert np.abs(filled - plane)[hole].max() < 0.12 * radius * reach


def test_an_image_of_which_nothing_is_known_is_continued_by_nothing() -> None:
    assert (continued(np.full((9, 7), 5, np.float32), np.zeros((9, 7), bool)) == 0).all()


@pytest.mark.parametrize("noise_dn", [1.0, 60.0])
@pytest.mark.parametrize(("offset_px", "range_factor"), [((0, 0), 1), ((12, 9), 1), ((0, 0), 1.06), ((3, -4), 0.95)])
def test_a_dark_sky_hides_nothing_however_noisy_and_wherever_the_pose_is(
    noise_dn: float, offset_px: tuple[float, float], range_factor: float
) -> None:
    light, _ = moon()
    pose = planted(TRUTH, CAMERA, offset_px, range_factor, (0, 0, 0))
    seen = observed(SKY_DN + light, noise_dn)
    assert light_behind(seen, pose, SCENE, framed_window(SCENE, pose)) is None
    assert match_scene(seen, SCENE, pose).simulation.hides == 0


@pytest.mark.parametrize("scattered", [0.02, 0.06])
@pytest.mark.parametrize("diameter_px", [14, 30])
def test_light_that_optics_scatter_around_a_small_disk_is_no_body_behind_it(diameter_px: int, scattered: float) -> None:
    """A disk that is less than half a per cent of its frame, with a halo of 12 px beside a sharp core."""
    camera = small_camera(diameter_px=diameter_px, size_px=(900, 900))
    scene, truth = scene_of(camera, "mixture", oversample=3), true_pose(camera, (430.4, 461.7))
    light = clean_image(scene_of(camera, "lunar-lambert", oversample=7), truth) - np.float32(SKY_DN)
    halo = np.asarray(gaussian_filter(light.astype(float), 12.0))
    seen = observed(SKY_DN + (1 - scattered) * light + scattered * halo * light.max() / halo.max(), 1.0)
    assert light_behind(seen, truth, scene, framed_window(scene, truth)) is None


@pytest.mark.parametrize("hides", [False, True])
def test_a_bright_uneven_sky_that_the_night_side_does_not_hide_is_no_body_behind(hides: bool) -> None:
    """As beside Neptune in Voyager's C1201656: stray light brighter than half of the crescent's."""
    truth = true_pose(CAMERA, (108.4, 101.7), phase_deg=110.0)
    light = clean_image(SCENE, truth) - np.float32(SKY_DN)
    full = truth.replaced(sun_from_target_km=-1000 * truth.target_from_spacecraft_km)
    covered = independent_image(CAMERA, SCENE.target, full, {"lommel-seeliger": 1.0}, uniform_map())
    nx, ny = CAMERA.size_px
    y, x = np.mgrid[:ny, :nx]
    sky = 100 * (x / nx) ** 2 + 20 * (y / ny)
    seen = observed(SKY_DN + light + sky * (1 - covered if hides else 1), 2.0)
    found = light_behind(seen, truth, SCENE, framed_window(SCENE, truth))
    assert (found is not None) is hides


@pytest.mark.parametrize("ratio", RATIOS)
def test_light_behind_is_the_planets_as_if_no_moon_were_there(ratio: float) -> None:
    window = framed_window(SCENE, TRUTH)
    quality = np.zeros(CAMERA.size_px[::-1], np.uint16)
    quality[::9, ::7] = Quality.RESEAU
    seen = in_front(ratio)
    seen = Observation(np.where(quality > 0, np.nan, seen.image).astype(np.float32), seen.noise, quality)
    found = light_behind(seen, TRUTH, SCENE, window)
    assert found is not None
    true = window.crop(planet(ratio) + SKY_DN - found.dark)
    assert np.abs(found.light - true)[found.near].max() < 0.05 * true.max() + 3 * NOISE_DN
    assert found.near.mean() > 0.5


def test_nothing_is_hidden_where_the_profile_says_so() -> None:
    never = scene_of(CAMERA, "mixture", oversample=3, behind_share=None)
    assert match_scene(in_front(1.0), never, TRUTH).simulation.hides == 0


@pytest.mark.parametrize("is_behind", [True, False])
def test_the_image_tells_whether_light_is_behind_the_target_or_in_front_of_it(is_behind: bool) -> None:
    light, _ = moon()
    # Some sky is left: what is bright all over the frame would be its dark level.
    seen = in_front(0.5, 165.0) if is_behind else observed(SKY_DN + light + planet(0.5, 165.0))
    match = match_scene(seen, SCENE, TRUTH)
    _, coefficients = fit_brightness(match, match.simulation.bases)
    share = float(coefficients[len(match.simulation.of_target)])
    print(f"hidden: {share:.2f}")
    assert match.simulation.hides == 1
    assert 0.7 < share < 1.4 if is_behind else abs(share) < 0.3


@pytest.mark.parametrize("ratio", RATIOS)
def test_edges_of_a_limb_are_found_whether_it_steps_down_or_up(ratio: float) -> None:
    match = match_scene(in_front(ratio), SCENE, TRUTH, framed_window(SCENE, TRUTH, margin_px=16))
    edges = measure_limb(match, LimbSettings())
    print(len(edges.shift_px), np.median(edges.across_px), np.sqrt(np.mean(edges.across_px**2)))
    assert match.simulation.hides == 1
    assert len(edges.shift_px) > 30
    assert abs(np.median(edges.across_px)) < 0.1


@pytest.mark.parametrize("edge_px", [1e9, 100.0], ids=["in front", "across its limb"])
@pytest.mark.parametrize("ratio", RATIOS)
def test_a_moon_is_found_unaided_in_front_of_its_planet(ratio: float, edge_px: float) -> None:
    found = find_pointing(in_front(ratio, edge_px), WRONG, SCENE, SETTINGS)
    print(f"{error_px(found.pose):.3f} px, likeness {found.evidence['likeness']:.3f}")
    assert error_px(found.pose) < 0.5
    assert found.evidence["likeness"] > 0.9


@pytest.mark.parametrize("ratio", [0.5, 2.0])
@pytest.mark.parametrize("edge_px", [1e9, 110.0], ids=["whole", "with its limb"])
def test_a_planet_without_a_moon_is_no_moon(ratio: float, edge_px: float) -> None:
    alone = observed(SKY_DN + planet(ratio, edge_px))
    with pytest.raises(PlanetposeError):
        find_pointing(alone, WRONG, SCENE, SETTINGS)


@pytest.mark.parametrize("ratio", RATIOS)
def test_at_the_true_pose_the_image_is_like_the_simulation_and_elsewhere_not(ratio: float) -> None:
    seen = in_front(ratio)
    away = planted(TRUTH, CAMERA, (-62.0, 20.0), 1, (0, 0, 0))
    assert likeness(with_rim(seen, TRUTH, SCENE)) > 0.95
    assert likeness(with_rim(seen, away, SCENE)) < 0.6


@pytest.mark.parametrize("ratio", RATIOS)
def test_the_joint_solution_in_front_of_a_planet_is_right_within_its_errors(ratio: float) -> None:
    start = planted(TRUTH, CAMERA, (0.7, -0.5), 1.003, (0, 0, 0))
    found = find_pose_jointly(
        in_front(ratio), start, start, "file", SCENE, JointSettings(second_start=False, oversample=2)
    )
    error = np.array(pose_error(found.pose, TRUTH, CAMERA, SCENE.target).centre_px)
    sigma = np.array(found.uncertainty["offset_px"])
    print(f"ratio {ratio}: {error.round(3)} px, sigma {sigma.round(3)}")
    assert np.hypot(*error) < 0.15
    assert (np.abs(error) < 4 * sigma).all()


def test_with_nothing_behind_the_score_is_a_normalised_correlation() -> None:
    rng = np.random.default_rng(2)
    image, disk = rng.standard_normal((30, 34)), rng.random((7, 9))
    usable = rng.random(image.shape) > 0.1
    scores, counts = hidden_scores(image, usable, np.zeros_like(image), disk, np.ones_like(disk), 0.5)
    for row, column in ((10, 12), (20, 20), (28, 33)):
        here = slice(row - 6, row + 1), slice(column - 8, column + 1)
        inside = usable[here]
        expected = np.corrcoef(image[here][inside], disk[inside])[0, 1]
        assert scores[row, column] == pytest.approx(max(expected, 0), abs=1e-6)
        assert counts[row, column] == pytest.approx(inside.sum())


def test_a_whole_disk_that_fits_tells_more_than_a_corner_that_fits_a_little_better() -> None:
    whole, corner, nothing = evidence(np.array([0.90, 0.92, 0.0]), np.array([1000.0, 300.0, 1000.0]))
    assert whole > corner > nothing == 0
