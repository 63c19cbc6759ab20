"""Images of a sequence share where their target is, apart from its ephemeris: planted offsets, by images with stars."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from catalog.pose import Pose
from catalog.rotation import rotation_from_vector_deg
from catalog.target import find_target
from lab.simulate.small_world import small_camera, true_pose
from tasks.adjust import AdjustSettings, adjust
from tasks.adjust.measurement import Measurement
from tasks.adjust.report import adjusted, report_of
from tasks.adjust.table import adjustment_table
from tasks.adjust.target_offset import Sight, camera_sigma_px, pixels_by_km, pose_with_target, solved
from tasks.joint.parameters import ATTITUDE, NAMES, OFFSET, State, difference
from tasks.stars.separate import StarOrientation

Array = NDArray[np.float64]
CAMERA = small_camera()
SIGMA = np.array([0.03, 0.04, 4e-4, 0.02, 0.1, 0.12, 0.08, 0.05])
NOISE = np.array([0.01, 0.01, 1e-4, 0.01, 0.02, 0.02, 0.02, 0.01])
STARS_DEG2 = np.diag([2e-5, 3e-5, 1e-3]) ** 2
OFFSET_KM = np.array([20.0, -35.0, 12.0])
SETTINGS = AdjustSettings()


def sequence(random: np.random.Generator, with_stars: tuple[bool, ...]) -> tuple[list[Measurement], list[Pose]]:
    """Joint results of images, and their true poses. Errors of the surface are the same in all."""
    start = true_pose(CAMERA)
    model = find_target("europa").rotation
    assert model is not None
    surface = random.normal(0, np.sqrt(SIGMA**2 - NOISE**2)[OFFSET])
    images, truths = [], []
    for number, has_stars in enumerate(with_stars):
        body = model.body_from_j2000(start.et + 60.0 * number - start.range_km / 299792.458)
        turn = rotation_from_vector_deg(np.append(random.normal(0, 0.02, 2), random.normal(0, 0.3)))
        truth = start.replaced(
            et=start.et + 60.0 * number, camera_from_j2000=turn @ start.camera_from_j2000, body_from_j2000=body
        )
        errors = random.normal(0, np.sqrt(np.diag(STARS_DEG2))) if has_stars else random.normal(0, 0.02, 3)
        camera_from_j2000 = rotation_from_vector_deg(errors) @ truth.camera_from_j2000
        predicted = truth.replaced(
            camera_from_j2000=camera_from_j2000,
            target_from_spacecraft_km=truth.target_from_spacecraft_km - OFFSET_KM,
        )
        step = difference(State(truth, 0.8), State(predicted, 0.8), CAMERA)
        step[OFFSET] += surface + random.normal(0, NOISE[OFFSET])
        step[ATTITUDE] += random.normal(0, SIGMA[ATTITUDE])
        prior = np.array([np.inf, np.inf, np.inf, 0.2, 1.0, 1.0, 1.0, 0.25])
        stars = StarOrientation(camera_from_j2000, STARS_DEG2) if has_stars else None
        held = np.array([name == "roll" and has_stars for name in NAMES])
        images.append(
            Measurement(
                f"i{number}", CAMERA, find_target("europa"), predicted, 0.8, step, np.diag(SIGMA**2), prior, held,
                2e-5, np.diag(NOISE**2), stars,
            )
        )  # fmt: skip
        truths.append(truth)
    return images, truths


def test_the_covariance_of_a_shared_offset_is_that_of_drawn_errors() -> None:
    """Four images of one surface: its error does not become smaller, those of stars and noise do."""
    random = np.random.default_rng(4)
    pose = true_pose(CAMERA)
    km, along = pixels_by_km(pose, CAMERA), pose.target_from_spacecraft_km / pose.range_km
    own, surface = np.diag([0.03, 0.02]) ** 2, np.array([[4e-4, 1e-4], [1e-4, 9e-4]])
    roots = np.linalg.cholesky(own), np.linalg.cholesky(surface)
    drawn, chi = [], []
    for _ in range(1500):
        common = roots[1] @ random.normal(size=2)
        places = [km @ OFFSET_KM + common + roots[0] @ random.normal(size=2) for _ in range(4)]
        sights = [Sight(i, place, own, surface, km) for i, place in enumerate(places)]
        found = solved(sights, pose.target_from_spacecraft_km, along * (along @ OFFSET_KM), 1e-5)
        drawn.append(km @ (found.offset_km - OFFSET_KM))
        chi.append(found.chi_square)
    stated = km @ found.covariance_km2 @ km.T
    assert np.cov(np.array(drawn).T) == pytest.approx(stated, rel=0.15, abs=5e-5)
    assert stated == pytest.approx(surface + own / 4, rel=1e-2)
    assert np.mean(drawn, axis=0) == pytest.approx([0, 0], abs=3e-3)
    assert found.degrees == 6
    assert np.mean(chi) == pytest.approx(6, rel=0.1)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_an_image_without_stars_gets_its_camera_from_the_target_that_others_place(seed: int) -> None:
    images, truths = sequence(np.random.default_rng(seed), (True, True, False, True))
    adjustment = adjust(images, SETTINGS)
    found = adjusted(images, adjustment)
    (offset,) = found.offsets
    assert offset is not None
    km = pixels_by_km(truths[0], CAMERA)
    sigma = np.sqrt(np.diag(km @ offset.covariance_km2 @ km.T))
    assert (np.abs(km @ (offset.offset_km - OFFSET_KM)) < 3.5 * sigma).all()
    assert offset.images == [0, 1, 3]
    assert offset.chi_square < 20
    for image, pose, truth in zip(images, found.poses, truths, strict=True):
        assert pose.target_from_spacecraft_km == pytest.approx(
            image.predicted.target_from_spacecraft_km + offset.offset_km, abs=1e-6
        )
        off = CAMERA.project(pose.camera_from_j2000 @ truth.camera_from_j2000[2]) - np.array(CAMERA.centre_px)
        assert (np.abs(off) < 4 * camera_sigma_px(image, offset)).all()
    seen = [CAMERA.project(pose.target_in_camera_km) for pose in found.poses]
    wanted = images[2].state_with(adjustment.shared[2], float(adjustment.theta[adjustment.of_sequence(0).start]))
    assert seen[2] == pytest.approx(CAMERA.project(wanted.pose.target_in_camera_km), abs=1e-6)


def test_without_stars_the_report_says_that_camera_and_target_cannot_be_separated() -> None:
    images, _ = sequence(np.random.default_rng(5), (False, False))
    adjustment = adjust(images, SETTINGS)
    found = adjusted(images, adjustment)
    assert found.offsets == [None]
    report = report_of(images, adjustment, found, SETTINGS)
    assert "cannot be separated" in report["sequences"][0]["target_offset"]["reason"]
    assert [row["camera_by"] for row in report["images"]] == [None, None]
    assert "cannot be separated" in adjustment_table(report)


def test_the_report_has_the_offset_and_the_images_that_it_is_by() -> None:
    images, _ = sequence(np.random.default_rng(6), (True, False))
    adjustment = adjust(images, SETTINGS)
    report = report_of(images, adjustment, adjusted(images, adjustment), SETTINGS)
    row = report["sequences"][0]["target_offset"]
    assert row["images_with_stars"] == ["i0"]
    assert row["probability"] is None
    assert np.array(row["covariance_km2"]).shape == (3, 3)
    assert [each["camera_by"] for each in report["images"]] == ["stars", "target"]
    assert "off its ephemeris" in adjustment_table(report)


def test_a_wrong_image_shows_in_the_chi_square_and_a_body_that_was_not_turned_stays() -> None:
    images, _ = sequence(np.random.default_rng(7), (True, True, True))
    step = images[1].step + np.array([0.5, 0, 0, 0, 0, 0, 0, 0])
    found = adjusted([images[0], replace(images[1], step=step), images[2]], adjust(images, SETTINGS))
    assert found.offsets[0] is not None
    assert found.offsets[0].chi_square > 50
    still = images[0].predicted
    assert np.array_equal(pose_with_target(images[0], still, found.offsets[0]).body_from_j2000, still.body_from_j2000)
