"""Close-ups: which frames are, how a motion moves them, what patches agree on, and what chance gives."""

from dataclasses import replace

import numpy as np
import pytest

from catalog.camera import Camera
from catalog.pose import Pose
from catalog.target import known_targets
from tasks.closeup import CloseUpSettings, is_close_up
from tasks.closeup.consensus import agreed, chance, grid
from tasks.closeup.fit import peaks_of, solved
from tasks.closeup.limb import weighted
from tasks.closeup.motion import ATTITUDE, RANGE, ROLL, SIZE, Anchor, moved, responses
from tasks.closeup.patches import correlated
from tasks.closeup.texture import Texture, texture_of
from tasks.project.points import body_points, pixels_of_points

CAMERA = Camera(name="test", size_px=(400, 300), centre_px=(199.5, 149.5), focal_length_px=3000.0)
EUROPA = known_targets()["europa"]


def pose_at(range_km: float, centre_px: tuple[float, float]) -> Pose:
    """A pose with the target's centre at a pixel."""
    target = CAMERA.ray(np.array(centre_px)) * range_km
    return Pose(0.0, np.eye(3), target, np.array([1.0, -2.0, -6.0]) * 1e8, np.eye(3))


@pytest.mark.parametrize(
    ("range_km", "centre_px", "expected"),
    [
        (40000.0, (200, 150), False),  # a disk of 117 px radius in the middle
        (40000.0, (900, 150), False),  # the same out of the frame: it is looked for
        (40000.0, (470, 150), False),  # less than a quarter in sight, but within reach it may be all of it
        (3000.0, (200, 150), True),  # the surface fills the frame
        (3000.0, (1500, 900), True),  # an arc of the limb
        (3000.0, (5000, 900), False),  # nothing of the body in the frame
        (9000.0, (200, 150), True),  # a disk of 520 px radius fills the frame, of which a seventh is in it
        (13000.0, (200, 150), False),  # more than a quarter of a disk of 360 px radius
        (13000.0, (650, 150), True),
    ],
)
def test_a_close_up_shows_less_than_a_quarter_of_the_disk(
    range_km: float, centre_px: tuple[float, float], expected: bool
) -> None:
    pose = pose_at(range_km, centre_px)
    assert is_close_up(pose, CAMERA, EUROPA, CloseUpSettings(reach_px=100)) is expected
    assert not is_close_up(pose, CAMERA, EUROPA, CloseUpSettings(share=0))
    fills = expected and centre_px in ((200, 150), (1500, 900))
    assert is_close_up(pose, CAMERA, EUROPA, CloseUpSettings(reach_px=100), has_map=False) is fills


def test_a_motion_moves_the_frame_as_its_unknowns_say() -> None:
    pose, xy = pose_at(3000.0, (900, 700)), np.array([[199.5, 149.5], [50.0, 40.0], [350.0, 250.0]])
    points, anchor = body_points(pose, CAMERA, EUROPA, xy), Anchor.at(pose, CAMERA, EUROPA, xy)

    def displacement(**step: float) -> np.ndarray:
        values = np.zeros(SIZE)
        for name, value in step.items():
            values[{"x": 0, "y": 1, "roll": ROLL, "range": RANGE}[name]] = value
        return pixels_of_points(moved(pose, CAMERA, anchor, values), CAMERA, points) - xy

    np.testing.assert_allclose(displacement(x=3.0, y=-2.0)[0], [3.0, -2.0], atol=1e-9)
    np.testing.assert_allclose(displacement(roll=1.0)[0], 0, atol=1e-9)
    across = displacement(roll=0.1)[1] @ (xy[1] - xy[0])
    assert abs(across) < 0.05 * np.linalg.norm(xy[1] - xy[0])
    np.testing.assert_allclose(displacement(range=0.01)[0], 0, atol=1e-7)
    step = np.array([2.0, -1.0, 0.05, 1e-3, 0.02, -0.03, 0.01])
    there = pixels_of_points(moved(pose, CAMERA, anchor, step), CAMERA, points) - xy
    np.testing.assert_allclose(responses(pose, CAMERA, EUROPA, anchor, xy) @ step, there, atol=0.02)


def markings(seed: int, shape: tuple[int, int], smooth: float = 1.5) -> np.ndarray:
    """Smooth random markings."""
    import cv2

    noise = np.random.default_rng(seed).normal(size=shape).astype(np.float32)
    return cv2.GaussianBlur(noise, (0, 0), smooth)


def texture(values: np.ndarray) -> Texture:
    """All of it known."""
    return texture_of(values.astype(np.float32), np.ones(values.shape, bool))


REACH = 24


def match(image: np.ndarray, wide: np.ndarray, rolls: np.ndarray | None = None):
    """Consensus of the patches of `image` on `wide`, which is larger by REACH on each side."""
    surfaces = correlated(texture(image), texture(wide), REACH, 6)
    response = np.zeros((len(surfaces), 2, SIZE))
    off = surfaces.centre_px - (np.array(image.shape[::-1]) - 1) / 2
    response[:, :, ROLL] = np.radians(1) * np.stack([-off[:, 1], off[:, 0]], axis=1)
    reach = REACH if rolls is None else REACH - 6
    return agreed(surfaces, response, np.zeros(1) if rolls is None else rolls, np.zeros(1), reach, 16)


@pytest.mark.parametrize("noise", [0.0, 1.0])
def test_the_place_that_all_patches_agree_on_is_found(noise: float) -> None:
    wide = markings(1, (96 + 2 * REACH, 120 + 2 * REACH))
    # What the map shows at (x + 7, y - 5) the image shows at (x, y): it must move by (-7, 5).
    image = wide[REACH - 5 : REACH - 5 + 96, REACH + 7 : REACH + 7 + 120]
    image = image + noise * wide.std() * np.random.default_rng(2).normal(size=image.shape)
    found = match(image, wide)
    np.testing.assert_array_equal(found.step[:2], [-7, 5])
    assert found.false_alarm < 1e-4
    assert found.height > 1.5 * found.rival


@pytest.mark.parametrize("smooth", [1.0, 3.0])
def test_chance_is_not_underestimated(smooth: float) -> None:
    """On unrelated markings of the same kind, the false-alarm probability is no smaller than how often it comes."""
    found = [
        match(markings(seed, (96, 96), smooth), markings(1000 + seed, (96 + 2 * REACH, 96 + 2 * REACH), smooth))
        for seed in range(60)
    ]
    probability = np.array([each.false_alarm for each in found])
    for limit in (0.3, 0.1, 0.02):
        assert np.mean(probability < limit) <= limit + 2 * np.sqrt(limit / len(found))


def test_a_roll_is_found_with_the_place() -> None:
    import cv2

    wide = markings(3, (160 + 2 * REACH, 160 + 2 * REACH))
    middle = (wide.shape[1] - 1) / 2
    turned = cv2.warpAffine(wide, cv2.getRotationMatrix2D((middle, middle), -3.0, 1.0), wide.shape[::-1])
    found = match(turned[REACH:-REACH, REACH:-REACH], wide, grid(2.0, 5.0, 2.0, 80 * np.radians(1)))
    assert found.step[ROLL] == pytest.approx(3.0, abs=0.8)
    assert found.false_alarm < 1e-4


def test_few_independent_places_need_a_higher_peak() -> None:
    probabilities = [chance(6.0, independent, 1000) for independent in (5, 20, 100, 1000)]
    assert probabilities == sorted(probabilities, reverse=True)
    assert chance(0.0, 100, 1000) == 1.0


def planted(count: int = 40) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Responses of patches, a step, and their displacements."""
    random = np.random.default_rng(5)
    xy = random.uniform(-100, 100, (count, 2))
    response = np.zeros((count, 2, SIZE))
    response[:, 0, 0] = response[:, 1, 1] = 1
    response[:, :, ROLL] = np.radians(1) * np.stack([-xy[:, 1], xy[:, 0]], axis=1)
    response[:, :, RANGE] = -xy
    response[:, :, ATTITUDE] = random.normal(size=(count, 2, 3))
    step = np.array([1.0, -0.5, 0.3, 0.01, 0.0, 0.0, 0.0])
    return response, step, response @ step


def test_the_fit_recovers_a_motion_in_spite_of_patches_elsewhere() -> None:
    response, step, displacement = planted()
    displacement = displacement + np.random.default_rng(6).normal(0, 0.1, displacement.shape)
    displacement[:8] += 5.0
    covariance = np.tile(0.01 * np.eye(2), (len(displacement), 1, 1))
    sigma = np.array([np.inf, np.inf, 1.0, 0.1, 0.0, 0.0, 0.0])
    found = solved(response, displacement, covariance, 0.02, np.zeros(SIZE), sigma, None)
    errors = np.abs(found.step - step)[:4] / np.sqrt(np.diag(found.covariance))[:4]
    assert errors.max() < 4
    assert np.abs(found.step[ATTITUDE]).max() < 1e-6  # held


def test_the_error_of_the_map_is_part_of_the_stated_one() -> None:
    response, _, displacement = planted()
    covariance = np.tile(np.eye(2), (len(displacement), 1, 1))
    sigma = np.array([np.inf, np.inf, 1.0, 0.1, 0.0, 0.0, 0.0])
    stated = [
        np.sqrt(solved(response, displacement, covariance, error, np.zeros(SIZE), sigma, None).covariance[0, 0])
        for error in (0.1, 1.0)
    ]
    assert stated[1] == pytest.approx(10 * stated[0], rel=0.2)


def test_a_ridge_says_nothing_along_itself() -> None:
    wide = np.tile(markings(7, (1, 100), 2.0), (100, 1)) + 0.05 * markings(8, (100, 100))
    image = wide[20:-20, 20:-20]
    surfaces = correlated(texture(image), texture(wide), 20, 3)
    peaks = peaks_of(surfaces)
    assert len(peaks.index)
    ratio = peaks.covariance[:, 1, 1] / peaks.covariance[:, 0, 0]
    assert np.median(ratio) > 5


def test_a_perfect_match_is_no_perfect_measurement() -> None:
    wide = markings(9, (100, 100))
    surfaces = correlated(texture(wide[20:-20, 20:-20]), texture(wide), 20, 3)
    perfect = replace(surfaces, correlation=surfaces.correlation / surfaces.correlation.max(axis=(1, 2), keepdims=True))
    assert np.linalg.eigvalsh(peaks_of(perfect).covariance).min() > 0


def test_a_short_arc_of_limb_says_little_along_itself() -> None:
    angle = np.radians(np.linspace(-8, 8, 90))
    normal = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    design = np.zeros((90, SIZE))
    design[:, :2] = normal
    information = weighted(design, 0.05**2, 900 * normal, 0.2).T @ design
    sigma = np.sqrt(np.diag(np.linalg.inv(information[:2, :2])))
    assert 0.15 < sigma[0] < 0.3
    assert sigma[1] > 1.0
