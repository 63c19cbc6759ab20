"""A camera's focal length and radial distortion by the stars of several frames: planted ones come back."""

import numpy as np
import pytest
from numpy.typing import NDArray

from catalog.camera import Camera
from catalog.camera_constants import DISTORTION, FOCAL_LENGTH, SOLVABLE
from catalog.rotation import rotation_from_vector_deg, vector_deg_from_rotation
from catalog.stars.observer import Observer
from catalog.stars.source import Cone
from lab.stars.frame import Faults, frame_of, height_of, places_of
from lab.stars.sky import made_up_sky, seen_directions
from tasks.stars.camera_fit import CameraFit, StarFrame, corrected, fit_camera
from tasks.stars.field import find_stars
from tasks.stars.match import Measured, match_stars
from tasks.stars.settings import StarSettings
from tasks.stars.solve import PREDICTED, Region
from tasks.stars.together import Together, fit_in_json, solved_text
from tasks.stars.together import frame_of as frame_found
from tasks.undistort import UndistortSettings

Array = NDArray[np.float64]
CAMERA = Camera(name="wide", size_px=(600, 500), centre_px=(299.5, 249.5), focal_length_px=4000.0, psf_sigma_px=1.0)
CORNER_PX = float(np.hypot(600, 500) / 2)


def bent(places: Array, shift_px: float) -> Array:
    """Where a camera with so much radial distortion in the corner has ideal places (n, 2)."""
    away = places - np.array(CAMERA.centre_px)
    return np.asarray(places + shift_px / CORNER_PX**3 * away * (away**2).sum(axis=1, keepdims=True))


def drawn(random: np.random.Generator, factor: float, shift_px: float, sigma_px: float, count: int = 40) -> StarFrame:
    """One frame of a camera of another focal length and distortion, identified with the nominal one."""
    truth = rotation_from_vector_deg(random.uniform(-180, 180, 3))
    ideal = random.uniform([0, 0], [599, 499], (count, 2))
    true = CAMERA.model_copy(update={"focal_length_px": CAMERA.focal_length_px * factor})
    directions = true.ray(ideal) @ truth
    sigmas = sigma_px * random.uniform(0.5, 2.0, count)
    seen = Measured(bent(ideal, shift_px) + sigmas[:, None] * random.normal(size=(count, 2)), sigmas, np.ones(count))
    near = rotation_from_vector_deg(random.normal(0, 0.003, 3)) @ truth
    found = match_stars(CAMERA, near, directions, np.zeros(count), seen, 3.0, 3)
    assert found is not None
    turned = found.orientation.camera_from_j2000
    return StarFrame("f", directions, np.zeros(count), seen, found.detection, found.star, turned)


def solved(frames: list[StarFrame], solve: tuple[str, ...] = SOLVABLE) -> CameraFit:
    fit = fit_camera(CAMERA, frames, solve, 3.0, 3)
    assert fit is not None
    return fit


def test_stated_errors_are_those_of_chance() -> None:
    z = []
    for seed in range(20):
        random = np.random.default_rng(seed)
        fit = solved([drawn(random, 1.0005, -0.8, 0.1, 25) for _ in range(3)])
        off = fit.parameters - np.array([5e-4, -0.8 / CORNER_PX])
        z.append(np.linalg.inv(np.linalg.cholesky(fit.covariance)) @ off)
    assert np.abs(np.mean(z, axis=0)).max() < 0.7
    assert np.sqrt(np.mean(np.square(z), axis=0)) == pytest.approx([1, 1], rel=0.35)


@pytest.mark.parametrize(("factor", "shift_px"), [(1.003, 0.0), (0.996, 0.0), (1.0, 4.0), (1.002, -3.0), (0.998, 5.0)])
def test_a_camera_that_is_off_is_found_and_the_stars_of_its_corners_with_it(factor: float, shift_px: float) -> None:
    """Some places are off by more than the search allows: with the catalog's camera those stars are not identified."""
    random = np.random.default_rng(8)
    frames = [drawn(random, factor, shift_px, 0.05, 60) for _ in range(4)]
    fit = solved(frames)
    assert sum(len(each.star) for each in fit.frames) == 240
    sigma = np.sqrt(np.diag(fit.covariance))
    assert (np.abs(fit.parameters - [factor - 1, shift_px / CORNER_PX]) < 4 * sigma).all()
    assert sigma[0] < 5e-5
    assert fit.rms_px[1] < 0.12 < fit.rms_px[0]


def test_what_is_not_solved_for_stays_and_text_and_json_say_what_was() -> None:
    random = np.random.default_rng(2)
    frames = [drawn(random, 1.001, 0.0, 0.05) for _ in range(2)]
    fit = solved(frames, (FOCAL_LENGTH,))
    content = fit_in_json(fit, (FOCAL_LENGTH,))
    assert fit.parameters[1] == 0
    assert content["distortion"] is None
    factor = content["focal_length_factor"]
    assert abs(factor["value"] - 1.001) < 4 * factor["sigma"]
    assert "focal length 4003.9" in solved_text(content)
    assert "radial distortion" in solved_text(fit_in_json(solved(frames, (DISTORTION,)), (DISTORTION,)))


def test_corrected_places_are_the_inverse_of_the_model() -> None:
    random = np.random.default_rng(3)
    ideal = random.uniform([0, 0], [599, 499], (50, 2))
    scaled = np.array(CAMERA.centre_px) + 1.002 * (ideal - CAMERA.centre_px)
    assert corrected(CAMERA, np.array([0.002, 6.0 / CORNER_PX]), bent(scaled, 6.0)) == pytest.approx(ideal, abs=1e-6)


def test_too_few_stars_are_no_answer() -> None:
    frame = drawn(np.random.default_rng(4), 1.0, 0.0, 0.05, 4)
    assert fit_camera(CAMERA, [frame], SOLVABLE, 3.0, 3) is None


def test_pictures_of_a_camera_with_another_focal_length_give_it() -> None:
    """From pixels on: stars drawn by another renderer, searched with the catalog's camera."""
    random, together = np.random.default_rng(5), Together(SOLVABLE, StarSettings().identification)
    true = CAMERA.model_copy(update={"focal_length_px": 4006.0})
    for _ in range(2):
        truth = rotation_from_vector_deg(random.uniform(-180, 180, 3))
        sky = made_up_sky(truth[2], 12.0, 0.7, random)
        directions = seen_directions(sky.table, 2010.0, np.zeros(3))
        places = bent(places_of(true, truth, directions), 1.0)
        shown = np.isfinite(places).all(axis=1)
        heights = np.array([height_of(min(6 * 10 ** (0.4 * (12 - m)), 500), 1.0) for m in sky.table.magnitude[shown]])
        picture = frame_of(CAMERA, places[shown], heights, 1.0, Faults(), random)
        near = rotation_from_vector_deg([0.05, -0.04, 0.1]) @ truth
        found = find_stars(
            picture, CAMERA, sky, Observer(10 * 365.25 * 86400.0, np.zeros(3)),
            [Region(PREDICTED, Cone(near[2], 1.0), near)], StarSettings(), UndistortSettings(), undistorted=True,
        )  # fmt: skip
        assert found.lock is not None
        frame = frame_found("f", found)
        assert np.abs(vector_deg_from_rotation(frame.camera_from_j2000 @ truth.T)[:2]).max() < 1e-3
        together.frames.setdefault("wide", []).append(frame)
    together.cameras["wide"] = CAMERA
    (row,) = together.in_json()
    focal, distortion = row["focal_length_px"], row["distortion"]
    assert abs(focal["value"] - 4006.0) < 4 * focal["sigma"] < 4.0
    assert abs(distortion["corner_shift_px"] - 1.0) < 4 * distortion["sigma_px"] < 0.8
