"""Exposures smeared along a line: the trail's own equations, and planted trails that must not move the target."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from catalog.basemap import uniform_map
from catalog.camera import Camera
from catalog.observation import Observation
from catalog.pose import Pose
from lab.simulate.small_world import scene_of, small_camera, true_pose
from tasks.correction import Correction
from tasks.joint import JointSettings, find_pose_jointly
from tasks.joint.derivatives import trail_columns
from tasks.point.rotation import pose_moved_by
from tasks.simulate.trail import line_kernel, smeared

RADIUS_PX, FINE, SIZE_PX = 40.0, 5, (112, 104)
CENTRE_PX = (55.0, 51.0)
parts = st.floats(-8, 8).filter(lambda v: abs(v) > 0.1)


@given(parts, parts)
@settings(max_examples=40, deadline=None)
def test_a_trail_spreads_evenly_about_its_middle(x: float, y: float) -> None:
    kernel = line_kernel((x, y))
    rows, columns = np.indices(kernel.shape) - kernel.shape[0] // 2
    assert kernel.sum() == pytest.approx(1)
    assert (kernel * columns).sum() == pytest.approx(0, abs=1e-9)
    assert (kernel * rows).sum() == pytest.approx(0, abs=1e-9)
    assert (kernel * rows * columns).sum() == pytest.approx(x * y / 12, abs=1e-3)
    # A box's variance, and up to a quarter of a square pixel from sharing each point among its neighbours.
    for places, part in ((columns, x), (rows, y)):
        assert part**2 / 12 - 1e-3 <= (kernel * places**2).sum() <= part**2 / 12 + 0.251


def test_the_image_changes_with_the_trail_as_its_columns_say() -> None:
    rows, columns = np.mgrid[:41, :41] - 20.0
    spot = np.exp(-(columns**2 + rows**2) / 18).astype(np.float32)
    trail, step = (3.0, 1.5), (0.2, -0.1)
    expected = smeared(spot, (trail[0] + step[0], trail[1] + step[1])) - smeared(spot, trail)
    assert np.tensordot(step, trail_columns(spot, trail), 1) == pytest.approx(
        expected, abs=0.1 * float(np.abs(expected).max())
    )


def sphere(pose: Pose, camera: Camera, trail_px: tuple[float, float]) -> NDArray[np.float64]:
    """A Lambert sphere drawn apart from the program's own renderer: sub-pixels, blurred by a Gaussian and a box."""
    from scipy.ndimage import gaussian_filter, shift

    nx, ny = SIZE_PX
    y, x = np.mgrid[: ny * FINE, : nx * FINE]
    place = np.stack([(x + 0.5) / FINE - 0.5, (y + 0.5) / FINE - 0.5], -1)
    ray = np.dstack([(place - camera.centre_px) / camera.focal_length_px, np.ones(x.shape)])
    ray /= np.linalg.norm(ray, axis=-1, keepdims=True)
    towards, radius = pose.target_in_camera_km, scene_of(camera).target.mean_radius_km
    along = ray @ towards
    inside = along**2 - (towards @ towards - radius**2)
    point = ray * (along - np.sqrt(np.maximum(inside, 0)))[..., None] - towards
    sun = pose.camera_from_j2000 @ pose.sun_from_target_km
    bright = np.where(inside > 0, np.maximum(point @ (sun / np.linalg.norm(sun)) / radius, 0), 0.0)
    bright = gaussian_filter(bright, 0.8 * FINE)
    if any(trail_px):
        places = np.linspace(-0.5, 0.5, 41)[:, None] * np.array(trail_px) * FINE
        bright = np.mean([shift(bright, (dy, dx), order=1) for dx, dy in places], axis=0)
    return np.asarray(bright.reshape(ny, FINE, nx, FINE).mean(axis=(1, 3)))


@cache
def solved(trail_px: tuple[float, float]) -> tuple[Correction, NDArray[np.float64]]:
    """Correction of a smeared picture, and how far its centre is off, px."""
    camera = small_camera(2 * RADIUS_PX, SIZE_PX).model_copy(update={"centre_px": CENTRE_PX})
    scene = scene_of(camera, basemap=uniform_map(), oversample=3)
    round_target = scene.target.model_copy(update={"radii_km": (scene.target.mean_radius_km,) * 3})
    scene = replace(scene, target=round_target)
    truth = true_pose(camera)
    image = 2000 * sphere(truth, camera, trail_px) + np.random.default_rng(1).normal(20, 6, SIZE_PX[::-1])
    noise = np.full(image.shape, 6, np.float32)
    seen = Observation(image.astype(np.float32), noise, np.zeros(image.shape, np.uint16))
    start = pose_moved_by(truth, camera, (0.8, -0.6)).with_range_factor(1.004)
    found = find_pose_jointly(seen, start, start, "file", scene, JointSettings(oversample=3))
    return found, camera.project(found.pose.target_in_camera_km) - camera.project(truth.target_in_camera_km)


@pytest.mark.parametrize("trail_px", [(0.0, 0.0), (3.0, 0.0), (0.0, 5.0), (-5.0, 5.0)])
def test_a_smeared_disk_stays_where_it_is_and_its_trail_is_found(trail_px: tuple[float, float]) -> None:
    found, off_px = solved(trail_px)
    smear, sigma = found.evidence["smear"], np.array(found.uncertainty["offset_px"])
    print(f"trail {trail_px}: centre off by {off_px.round(3)} px, sigma {sigma.round(3)}; found {smear}")
    assert np.hypot(*off_px) < 0.12
    assert (np.abs(off_px) < 4 * sigma).all()
    assert "doubt" not in found.evidence
    if not any(trail_px):
        assert smear is None
        return
    assert smear["length_px"] == pytest.approx(np.hypot(*trail_px), abs=0.6)
    turned_deg = (smear["direction_deg"] - np.degrees(np.arctan2(*trail_px[::-1])) + 90) % 180 - 90
    assert abs(turned_deg) < 6
