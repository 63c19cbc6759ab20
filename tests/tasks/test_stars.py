"""Star images: what is one and what is not, where it is, and what orientation they make."""

from itertools import islice

import numpy as np
import pytest

from catalog.camera import Camera
from catalog.observation import Observation, Quality
from catalog.rotation import rotation_from_vector_deg, vector_deg_from_rotation
from lab.stars.frame import Faults, frame_of, height_of
from tasks.stars.identify import Possible, brightest_pairs, hypotheses, sky_pairs
from tasks.stars.orientation import extra_sigma, fit_orientation, focal_length_factor
from tasks.stars.settings import DetectionSettings
from tasks.stars.solve import brightest_everywhere
from tasks.stars.sources import POINT, STAR, UNFIT, Sources, find_sources

CAMERA = Camera(name="test", size_px=(300, 240), centre_px=(149.5, 119.5), focal_length_px=6000.0, psf_sigma_px=1.0)


def observed(picture: np.ndarray) -> Observation:
    return Observation(
        picture.astype(np.float32), np.full(picture.shape, 2, np.float32), np.zeros(picture.shape, np.uint16)
    )


def drawn(places: list[tuple[float, float]], signal: float, psf: float = 1.0, seed: int = 0) -> Observation:
    heights = np.full(len(places), height_of(signal, psf))
    return frame_of(CAMERA, np.array(places, float).reshape(-1, 2), heights, psf, Faults(), np.random.default_rng(seed))


def nearest(sources: Sources, x: float, y: float) -> int:
    off = np.hypot(sources.xy_px[:, 0] - x, sources.xy_px[:, 1] - y)
    assert off.min() < 1.5
    return int(off.argmin())


PLACES = [(40.3 + 31 * column, 30.7 + 33.3 * row) for row in range(6) for column in range(8)]


@pytest.mark.parametrize("psf", [0.7, 1.0, 1.6, 2.5])
def test_places_of_stars_are_right_within_their_stated_errors(psf: float) -> None:
    sources = find_sources(drawn(PLACES, 20.0, psf), psf, DetectionSettings()).stars
    found = [nearest(sources, *place) for place in PLACES]
    off = sources.xy_px[found] - PLACES
    z = off / np.sqrt(np.stack([sources.covariance_px2[found, k, k] for k in range(2)], axis=-1))
    assert len(set(found)) == len(PLACES)
    assert np.sqrt((off**2).mean()) < 2.2 * psf / 20.0
    assert 0.7 < np.sqrt((z**2).mean()) < 1.4
    assert 10 < np.median(sources.signal_to_noise[found]) < 22  # in a crowded frame other stars count as noise


def test_a_wider_star_image_than_the_cameras_is_taken_from_the_frame() -> None:
    sources = find_sources(drawn(PLACES, 40.0, 1.7), 1.0, DetectionSettings())
    assert np.sqrt(np.diag(sources.shape_px2)) == pytest.approx([1.72, 1.72], rel=0.08)


def test_a_trail_is_the_shape_of_all_stars_of_a_frame() -> None:
    picture = sum(
        drawn([(x + step, y + step / 2) for x, y in PLACES], 12.0, 1.0, seed).image
        for seed, step in enumerate(np.linspace(-3, 3, 9))
    )
    sources = find_sources(observed(np.asarray(picture) / 3), 1.0, DetectionSettings())
    across, along = np.sqrt(np.linalg.eigvalsh(sources.shape_px2))
    assert along > 1.6 * across
    assert sources.shape_px2[0, 1] > 0
    found = sources.stars
    assert np.median([np.hypot(*(found.xy_px - place).T).min() for place in PLACES]) < 0.2


def test_hot_pixels_are_points_and_no_stars() -> None:
    observation = drawn(PLACES[:24], 30.0)
    picture = observation.image.copy()
    hot = [(55.0 + 31 * column, 213.0) for column in range(7)]
    for x, y in hot:
        picture[int(y), int(x)] += 120
    sources = find_sources(observed(picture), 1.0, DetectionSettings())
    assert POINT in {str(sources.kind[nearest(sources, *place)]) for place in hot} <= {POINT, UNFIT}
    assert {str(sources.kind[nearest(sources, *place)]) for place in PLACES[:24]} == {STAR}


@pytest.mark.parametrize("kind", ["limb", "ring", "edge"])
def test_limbs_rings_and_edges_are_no_stars(kind: str) -> None:
    y, x = np.mgrid[0:240, 0:300].astype(float)
    picture = drawn(PLACES[:8], 30.0).image.astype(float)
    if kind == "limb":
        picture += 3000.0 * np.clip(90 - np.hypot(x - 260, y - 200), 0, 1)
    elif kind == "ring":
        picture += 400.0 * np.exp(-((y - 150 - 0.4 * x + 0.0006 * x**2) ** 2) / 8)
    else:
        picture = np.where(x < 70, picture - 500, picture)
    sources = find_sources(observed(picture), 1.0, DetectionSettings()).stars
    expected = [place for place in PLACES[:8] if kind != "edge" or place[0] > 75]
    for place in expected:
        nearest(sources, *place)
    assert len(sources) <= len(PLACES[:8]) + 2


def test_unusable_pixels_make_no_star() -> None:
    observation = drawn(PLACES[:8], 60.0)
    x, y = (round(each) for each in PLACES[0])
    observation.quality[y - 1 : y + 2, x - 1 : x + 2] = Quality.RESEAU
    sources = find_sources(observation, 1.0, DetectionSettings()).stars
    assert np.hypot(sources.xy_px[:, 0] - x, sources.xy_px[:, 1] - y).min() > 5
    assert len(sources) == 7


def test_flat_dark_and_empty_frames_hold_no_stars() -> None:
    for picture in (np.zeros((60, 80)), np.full((60, 80), 7.0), np.full((60, 80), np.nan)):
        assert len(find_sources(observed(picture), 1.0, DetectionSettings()).stars) == 0
    nothing = Observation(*(np.zeros((60, 80), np.float32),) * 2, np.full((60, 80), Quality.MISSING, np.uint16))
    assert len(find_sources(nothing, 1.0, DetectionSettings())) == 0


def planted(count: int, sigma: float, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    random = np.random.default_rng(seed)
    truth = rotation_from_vector_deg(random.uniform(-180, 180, 3))
    xy = random.uniform(0, [300, 240], (count, 2))
    return truth, CAMERA.ray(xy) @ truth, xy + random.normal(0, sigma, (count, 2))


def test_an_orientation_has_the_errors_that_it_states() -> None:
    z = []
    for seed in range(60):
        truth, directions, xy = planted(12, 0.1, seed)
        start = rotation_from_vector_deg([0.01, -0.02, 0.1]) @ truth
        found = fit_orientation(CAMERA, start, directions, xy, np.full(12, 0.1))
        off = vector_deg_from_rotation(found.camera_from_j2000 @ truth.T)
        z.append(off / np.sqrt(np.diag(found.covariance_deg2)))
    assert 0.85 < np.sqrt((np.array(z) ** 2).mean()) < 1.15


def test_a_wrong_star_hardly_moves_the_orientation_and_understated_errors_are_raised() -> None:
    truth, directions, xy = planted(12, 0.1, 3)
    xy[0] += [1.5, 0.0]
    found = fit_orientation(CAMERA, truth, directions, xy, np.full(12, 0.1))
    off = vector_deg_from_rotation(found.camera_from_j2000 @ truth.T)
    assert np.radians(np.hypot(*off[:2])) * 6000 < 0.15
    assert found.weights[0] == found.weights.min() < 0.5
    scattered = fit_orientation(CAMERA, truth, directions, xy, np.full(12, 0.01))
    assert scattered.extra_sigma_px > 0.05
    assert extra_sigma(np.array([[0.1, 0.0], [0.0, 0.1], [0.1, 0.1]]), np.full(3, 0.5)) == 0.0


def test_a_planted_scale_is_measured() -> None:
    z = []
    for seed in range(40):
        truth, directions, _ = planted(15, 0.0, seed)
        larger = CAMERA.model_copy(update={"focal_length_px": 6000.0 * 1.002})
        xy = larger.project(directions @ truth.T) + np.random.default_rng(seed).normal(0, 0.1, (15, 2))
        found = fit_orientation(CAMERA, truth, directions, xy, np.full(15, 0.1))
        solved = focal_length_factor(CAMERA, found, directions, xy, np.full(15, 0.1))
        assert solved is not None
        z.append((solved[0] - 1.002) / solved[1])
    assert np.sqrt(np.mean(np.square(z))) < 1.3
    assert focal_length_factor(CAMERA, found, directions[:5], xy[:5], np.full(5, 0.1)) is None


def test_every_part_of_the_sky_keeps_as_many_of_its_brightest_stars() -> None:
    random = np.random.default_rng(4)
    v = random.normal(0, 1, (40_000, 3))
    v = np.concatenate([v, np.array([0, 0, 1.0]) + random.normal(0, 0.03, (20_000, 3))])
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    v = v[random.permutation(len(v))]
    kept = v[brightest_everywhere(v, np.radians(10), 20)]
    count = [int((kept @ axis > np.cos(np.radians(5.6))).sum()) for axis in (*np.eye(3), -np.eye(3)[2])]
    assert min(count) >= 12
    assert max(count) <= 32


def test_identification_finds_a_planted_orientation_and_states_what_chance_would_do() -> None:
    random = np.random.default_rng(5)
    stars = random.normal(0, 1, (10_000, 3))
    stars /= np.linalg.norm(stars, axis=1, keepdims=True)
    camera = CAMERA.model_copy(update={"focal_length_px": 1500.0})
    truth = rotation_from_vector_deg([40.0, -75.0, 110.0])
    v = stars @ truth.T
    xy = camera.project(v)
    inside = np.flatnonzero(((xy > 0) & (xy < [300, 240])).all(axis=1))
    rays = camera.ray(np.concatenate([random.uniform(0, [300, 240], (4, 2)), xy[inside][:14]]))
    pairs = sky_pairs(stars, np.radians(5))
    found = hypotheses(rays, pairs, 1.0 / 1500, 1e-4, np.radians(1), Possible())
    best = next(each for each in found if each.false_alarm < 1e-9)
    assert np.abs(vector_deg_from_rotation(best.camera_from_sky @ truth.T)).max() < 0.5
    # Within a cone that does not hold it there is nothing.
    elsewhere = Possible(np.radians(5), -truth[2])
    found = hypotheses(rays, pairs, 1.0 / 1500, 1e-4, np.radians(1), elsewhere)
    assert min(each.false_alarm for each in islice(found, 20)) > 1e-3
    assert brightest_pairs(3) == [(0, 1), (0, 2), (1, 2)]
