"""Distortion models: against formulas written out for one point, and there and back for any detector."""

import math
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from catalog.camera import Camera, camera_from_dict
from catalog.distortions import DISTORTIONS, Plate
from catalog.errors import RefusedError
from catalog.focal_plane import axes_of

CENTRE = (0.3, -0.2)
EM = (2.7e-5, -1.9e-5, -2.9e-5)
X = (0.001, 1.0018, 2e-4, 1e-4, -5e-4, 3e-5, 1e-5, 2e-6, 1e-5, -3e-6)
Y = (-0.002, 1e-4, 0.9990, 9e-4, 2e-5, 3.5e-4, 4e-6, 1e-5, -2e-6, 1e-5)
A1, A2 = (0.0054, 0.0024, -2e-5, 0.999, -1e-4, 0.0016), (9e-5, 0.0054, 0.0025, -3.6e-4, 0.997, -0.0176)
A3 = (-2.6e-5, -4e-6, -2.6e-5, 0.0054, 0.0016, 1.0)
PARAMETERS: dict[str, dict[str, Any]] = {
    "none": {},
    "ssi-cubic": {"corner_shift_px": 1.2, "corner_px": 565.0},
    "radial-k1": {"k1_per_mm2": -2.5e-5},
    "lorri-em": {"em": EM, "y_up": True},
    "radial-series": {"coefficients": (1e-4, 2.8e-5, -1e-7), "centre_mm": CENTRE},
    "radial-outward": {"coefficients": (0.0, 8.4e-5, 2e-8)},
    "radial-decentered": {"coefficients": (0.0, -2.4e-5, 0.0), "decentering": (2e-5, -1e-4), "centre_mm": CENTRE},
    "radial-all-powers": {"coefficients": (2e-5, 1.7e-4, 6e-5, 0.0, 1e-7), "centre_mm": CENTRE},
    "transverse": {"x": X, "y": Y},
    "rational": {"a1": A1, "a2": A2, "a3": A3},
    "radial-tangential": {"coefficients": (-0.5, 0.37, 2e-4, 9e-4, -0.18)},
    "legendre": {"x": np.linspace(-1e-3, 1e-3, 20).tolist(), "y": [1e-4] * 20, "half_mm": [8.0, 8.0]},
}


def written_out(name: str, x: float, y: float, f: float) -> tuple[float, float]:
    """The published formula, in the direction that it is published in."""
    r2 = x * x + y * y
    u, v = x - CENTRE[0], y - CENTRE[1]
    q2 = u * u + v * v
    if name == "radial-series":
        scale = 1 - 1e-4 - 2.8e-5 * q2 + 1e-7 * q2**2
        return u * scale + CENTRE[0], v * scale + CENTRE[1]
    if name == "radial-outward":
        scale = 1 + 8.4e-5 * r2 + 2e-8 * r2**2
        return x * scale, y * scale
    if name == "radial-decentered":
        dr, (p1, p2) = -2.4e-5 * q2, (2e-5, -1e-4)
        return (
            x + u * dr + p1 * (q2 + 2 * u * u) + 2 * p2 * u * v,
            y + v * dr + 2 * p1 * u * v + p2 * (q2 + 2 * v * v),
        )
    if name == "radial-all-powers":
        q = math.sqrt(q2)
        dr = 2e-5 + 1.7e-4 * q + 6e-5 * q**2 + 1e-7 * q**4
        return x + u * dr, y + v * dr
    if name == "transverse":
        terms = np.array([1, x, y, x * x, x * y, y * y, x**3, x * x * y, x * y * y, y**3])
        return float(terms @ X), float(terms @ Y)
    if name == "rational":
        chi = np.array([x * x, x * y, y * y, x, y, 1])
        return float(chi @ A1 / (chi @ A3)), float(chi @ A2 / (chi @ A3))
    if name == "lorri-em":
        scale = 1 + r2 * EM[0] + y * EM[1] + x * EM[2]
        return x * scale, y * scale
    k = np.array(PARAMETERS["radial-tangential"]["coefficients"])
    point, nothing = np.array([[[x / f, y / f, 1.0]]]), np.zeros(3)
    return tuple((cv2.projectPoints(point, nothing, nothing, np.eye(3), k)[0].ravel() * f).tolist())


@pytest.mark.parametrize(
    "name",
    ["radial-series", "radial-outward", "radial-decentered", "radial-all-powers", "transverse", "rational", "lorri-em",
     "radial-tangential"],
)  # fmt: skip
@given(x=st.floats(-7, 7), y=st.floats(-7, 7))
def test_a_model_is_its_published_formula(name: str, x: float, y: float) -> None:
    focal_length = 20.0
    build, _ = DISTORTIONS[name]
    forward = build(PARAMETERS[name], Plate(0.014, focal_length, 700.0))
    assert forward(np.array([[x, y]]))[0] == pytest.approx(written_out(name, x, y, focal_length), abs=1e-12)


def camera(model: str, mm_from_px: np.ndarray, handedness: int, focal_length_mm: float = 50.0) -> Camera:
    from catalog.kernel_camera import undistorted_frame

    size, origin = (900, 700), np.array([455.0, 340.0])
    content = undistorted_frame(mm_from_px, np.array([0.01, -0.02]), origin, size, handedness)
    distortion = {"model": model, **PARAMETERS[model]}
    return camera_from_dict(content | {"name": "c", "focal_length_mm": focal_length_mm, "distortion": distortion}, "c")


DETECTORS: dict[str, np.ndarray] = {
    "upright": np.diag([0.014, 0.014]),
    "lines upwards": np.diag([0.016, -0.016]),
    "turned by 90 degrees": np.array([[0.0, 0.0085], [0.0085, 0.0]]),
    "samples to the left": np.diag([-0.013, 0.013]),
    "not square": np.diag([0.0161, 0.0095]),
    "slightly turned": 0.014 * np.array([[math.cos(0.01), -math.sin(0.01)], [math.sin(0.01), math.cos(0.01)]]),
}


@pytest.mark.parametrize("model", PARAMETERS)
@pytest.mark.parametrize("detector", DETECTORS)
@pytest.mark.parametrize("handedness", [1, -1])
def test_rays_of_detector_pixels_lead_back_to_them(model: str, detector: str, handedness: int) -> None:
    made = camera(model, DETECTORS[detector], handedness)
    pixels = np.random.default_rng(1).uniform(0, 1, (40, 2)) * np.array(made.detector_size_px)
    rays = made.detector_ray(pixels.reshape(8, 5, 2))
    assert rays.shape == (8, 5, 3)
    assert np.linalg.norm(rays, axis=-1) == pytest.approx(np.ones((8, 5)))
    assert made.detector_pixel(rays).reshape(-1, 2) == pytest.approx(pixels, abs=1e-7)


@pytest.mark.parametrize("detector", DETECTORS)
@pytest.mark.parametrize("handedness", [1, -1])
def test_the_undistorted_frame_is_a_right_handed_picture_with_samples_to_the_right(
    detector: str, handedness: int
) -> None:
    """Rays in the instrument's frame are those of the focal plane, (x, y, +-f); the camera's frame is it, rotated."""
    mm_from_px = DETECTORS[detector]
    made = camera("none", mm_from_px, handedness)
    rotation = np.array(made.camera_from_instrument, dtype=float)
    assert np.linalg.det(rotation) == pytest.approx(1.0)
    pixel = np.array([700.0, 100.0])
    x, y = mm_from_px @ (pixel - [455.0, 340.0]) + [0.01, -0.02]
    direction = rotation @ np.array([x, y, handedness * 50.0])
    assert made.detector_ray(pixel) == pytest.approx(direction / np.linalg.norm(direction), abs=1e-12)
    to_the_right = made.project(made.detector_ray(pixel + np.array([10.0, 0.0]))) - made.project(
        made.detector_ray(pixel)
    )
    assert to_the_right[0] > abs(to_the_right[1])
    corners = np.array([[0, 0], [1, 0], [0, 1], [1, 1]]) * (np.array(made.detector_size_px) - 1)
    places = made.project(made.detector_ray(corners))
    slack = 12.0  # the slight turn, and the constants
    assert (places > -slack).all()
    assert (places < np.array(made.size_px) + slack).all()


def test_axes_follow_the_handedness() -> None:
    assert axes_of(np.diag([0.01, 0.01]), 1) == ((1, 0), (0, 1))
    assert axes_of(np.diag([0.01, 0.01]), -1) == ((1, 0), (0, -1))


@pytest.mark.parametrize(
    ("model", "parameters", "named"),
    [
        ("transverse", {"x": [1.0] * 9, "y": [1.0] * 10}, "10 numbers"),
        ("legendre", {"x": [1.0] * 20, "y": [1.0] * 20}, "half_mm"),
        ("radial-series", {"coefficients": [float("nan")]}, "finite"),
        ("radial-k1", {}, "k1_per_mm2"),
        ("fisheye", {}, "fisheye"),
    ],
)
def test_wrong_parameters_are_named(model: str, parameters: dict[str, Any], named: str) -> None:
    content = {"name": "c", "size_px": (9, 9), "centre_px": (4, 4), "focal_length_mm": 9.0, "pixel_pitch_mm": 0.01}
    made = camera_from_dict(content | {"distortion": {"model": model, **parameters}}, "c")
    with pytest.raises(RefusedError, match=named):
        made.detector_ray([1.0, 1.0])


def test_a_reseau_cameras_rays_need_its_marks() -> None:
    from catalog.camera import find_camera

    with pytest.raises(RefusedError, match="marks of each image"):
        find_camera("voyager1-nac").detector_ray([400.0, 400.0])


def test_an_impossible_focal_plane_is_refused() -> None:
    content: dict[str, Any] = {"name": "c", "size_px": (9, 9), "centre_px": (4, 4), "focal_length_px": 900.0}
    for plane in (
        {"origin_px": (4, 4), "mm_from_px": ((0.01, 0.01), (0.01, 0.01))},
        {"origin_px": (4, 4), "mm_from_px": ((0.01, 0), (0, 0.01)), "axes": ((1, 0), (1, 0))},
        {"origin_px": (float("inf"), 4), "mm_from_px": ((0.01, 0), (0, 0.01))},
    ):
        with pytest.raises(RefusedError, match="focal_plane"):
            camera_from_dict(content | {"focal_plane": plane}, "c")
