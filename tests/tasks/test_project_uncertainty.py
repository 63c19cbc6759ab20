"""Propagated coordinate errors against projections of disturbed poses."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from catalog.camera import Camera
from catalog.pose import Pose
from catalog.rotation import rotation_from_vector_deg
from catalog.target import Target
from tasks.project.curves import limb_points
from tasks.project.points import body_points, latitude_longitude
from tasks.project.uncertainty import PARAMETERS, PoseUncertainty, coordinate_jacobian, coordinate_sigmas

CAMERA = Camera(name="test", size_px=(400, 400), centre_px=(200.0, 198.0), focal_length_px=1e5)
BODY = Target(name="Body", naif_id=1, radii_km=(1829.4, 1819.4, 1500.7))


def pose_of(turn=(20.0, 50.0, -70.0)):
    camera_from_j2000 = rotation_from_vector_deg([17.0, 57.0, -110.0])
    to_target = camera_from_j2000.T @ (CAMERA.ray([230.0, 150.0]) * 1.2e6)
    return Pose(0.0, camera_from_j2000, to_target, np.array([7e8, 1e8, 0]), rotation_from_vector_deg(turn))


def coordinates(pose, xy, step):
    """Latitude and longitude at xy after moving the pose by `step` (6,), in the order of PARAMETERS."""
    moved = CAMERA.model_copy(update={"centre_px": tuple(np.asarray(CAMERA.centre_px) + step[:2])})
    body = rotation_from_vector_deg(step[3:]).T @ pose.body_from_j2000
    disturbed = pose.with_range_factor(1 + step[2]).replaced(body_from_j2000=body)
    return latitude_longitude(body_points(disturbed, moved, BODY, xy))


def grid_on_disk(pose, fraction=0.95):
    radius = 1500 / pose.range_km * CAMERA.focal_length_px
    angle, r = np.meshgrid(np.linspace(0, 2 * np.pi, 25), np.linspace(0, fraction, 8))
    centre = CAMERA.project(pose.target_in_camera_km)
    return (centre + radius * (r[..., None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1))).reshape(-1, 2)


def points_at(pose, xy):
    return body_points(pose, CAMERA, BODY, xy).T


@given(st.tuples(*[st.floats(-180, 180)] * 3))
@settings(max_examples=20, deadline=None)
def test_the_jacobian_is_what_disturbed_projections_show(turn):
    pose = pose_of(turn)
    xy = grid_on_disk(pose, 0.8)
    jacobian = coordinate_jacobian(pose, CAMERA, BODY, points_at(pose, xy))
    latitude, _ = latitude_longitude(body_points(pose, CAMERA, BODY, xy))
    away_from_poles = np.abs(latitude) < 80
    for i, name in enumerate(PARAMETERS):
        step = np.zeros(6)
        step[i] = {"o": 1e-3, "r": 1e-6, "a": 1e-4}[name[0]]
        plus, minus = (coordinates(pose, xy, sign * step) for sign in (1, -1))
        for analytic, p, m in zip(jacobian, plus, minus, strict=True):
            numeric = ((p - m + 180) % 360 - 180) / (2 * step[i])
            scale = max(1e-6, np.abs(numeric[away_from_poles]).max())
            assert np.abs(analytic[i] - numeric)[away_from_poles].max() < 1e-4 * scale, name


def test_sigmas_are_the_scatter_of_random_poses():
    pose = pose_of()
    xy = grid_on_disk(pose)
    sigmas = {"offset_px": [0.2, 0.1], "range_factor": 5e-4, "attitude_deg": [0.05, 0.02, 0.08]}
    uncertainty = PoseUncertainty.from_sigmas(sigmas)
    found = coordinate_sigmas(pose, CAMERA, BODY, uncertainty, points_at(pose, xy))
    steps = np.random.default_rng(3).normal(size=(1500, 6)) * np.sqrt(np.diag(uncertainty.covariance))
    base = coordinates(pose, xy, np.zeros(6))
    samples = np.array([coordinates(pose, xy, step) for step in steps]) - np.array(base)
    scatter = np.sqrt(np.nanmean(((samples + 180) % 360 - 180) ** 2, axis=0))
    steady = np.abs(base[0]) < 75
    for sigma, seen in zip(found, scatter, strict=True):
        assert np.abs(sigma / seen - 1)[steady].max() < 0.12


def test_correlations_count():
    """Offsets in x and y that are always the same add like numbers, not like independent errors."""
    pose = pose_of()
    xy = grid_on_disk(pose, 0.3)
    covariance = np.zeros((6, 6))
    covariance[:2, :2] = 1.0
    together = coordinate_sigmas(pose, CAMERA, BODY, PoseUncertainty(covariance), points_at(pose, xy))
    latitude, longitude = coordinate_jacobian(pose, CAMERA, BODY, points_at(pose, xy))
    assert np.allclose(together[0], np.abs(latitude[:2].sum(axis=0)), atol=1e-7)
    assert np.allclose(together[1], np.abs(longitude[:2].sum(axis=0)), atol=1e-7)


def test_the_scatter_of_the_places_themselves_counts():
    """The distortion's error against projections of pixels that are moved at random, beside a known pose error."""
    pose = pose_of()
    xy = grid_on_disk(pose)
    place_px = np.linspace(0.05, 0.4, len(xy))
    uncertainty = PoseUncertainty.from_sigmas({"offset_px": [0.1, 0.1], "range_factor": 0, "attitude_deg": [0, 0, 0]})
    found = coordinate_sigmas(pose, CAMERA, BODY, uncertainty, points_at(pose, xy), place_px)
    steps = np.random.default_rng(4).normal(size=(1500, *xy.shape)) * np.hypot(place_px, 0.1)[:, None]
    base = coordinates(pose, xy, np.zeros(6))
    samples = np.array([coordinates(pose, xy + step, np.zeros(6)) for step in steps]) - np.array(base)
    scatter = np.sqrt(np.nanmean(((samples + 180) % 360 - 180) ** 2, axis=0))
    steady = np.abs(base[0]) < 75
    for sigma, seen in zip(found, scatter, strict=True):
        assert np.abs(sigma / seen - 1)[steady].max() < 0.12


def test_unknown_parts_are_listed_and_wrong_ones_refused():
    known = PoseUncertainty.from_sigmas({"offset_px": [0.1, 0.1], "range_factor": None})
    assert known.not_included == ("range_factor", "attitude_deg")
    with pytest.raises(ValueError, match="offset_px must be 2"):
        PoseUncertainty.from_sigmas({"offset_px": [0.1]})
    with pytest.raises(ValueError, match=r"\(6, 6\)"):
        PoseUncertainty(np.zeros((3, 3)))


def test_near_the_limb_the_uncertainty_is_large_but_finite():
    pose = pose_of()
    uncertainty = PoseUncertainty.from_sigmas({"offset_px": [0.5, 0.5], "range_factor": 0, "attitude_deg": [0, 0, 0]})
    centre = CAMERA.project(pose.target_in_camera_km)
    edge = centre + (limb_points(pose, CAMERA, BODY, 90) - centre) * (1 - 1e-9)
    at_centre, at_edge = (
        np.stack(coordinate_sigmas(pose, CAMERA, BODY, uncertainty, points_at(pose, xy))) for xy in ([centre], edge)
    )
    assert np.isfinite(at_edge).all()
    assert np.median(at_edge[0]) > 100 * at_centre[0]
    assert (at_edge[0] <= 90).all()
    assert (at_edge[1] <= 180).all()
