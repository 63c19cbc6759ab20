"""Propagated coordinate errors against projections of disturbed poses."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from catalog.camera import Camera
from catalog.pose import Pose
from catalog.rotation import rotation_from_vector_deg
from catalog.target import Target
from tasks.joint.parameters import State
from tasks.project.curves import limb_points
from tasks.project.points import body_points, latitude_longitude
from tasks.project.uncertainty import (
    PARAMETERS,
    PoseUncertainty,
    coordinate_jacobian,
    coordinate_sigmas,
    stated_uncertainty,
)

CAMERA = Camera(name="test", size_px=(400, 400), centre_px=(200.0, 198.0), focal_length_px=1e5)
BODY = Target(name="Body", naif_id=1, radii_km=(1829.4, 1819.4, 1500.7))


def pose_of(turn=(20.0, 50.0, -70.0)):
    camera_from_j2000 = rotation_from_vector_deg([17.0, 57.0, -110.0])
    to_target = camera_from_j2000.T @ (CAMERA.ray([230.0, 150.0]) * 1.2e6)
    return Pose(0.0, camera_from_j2000, to_target, np.array([7e8, 1e8, 0]), rotation_from_vector_deg(turn))


def coordinates(pose, xy, step, camera=CAMERA):
    """Latitude and longitude at xy after moving the pose by `step` (7,), in the order of PARAMETERS, as the joint
    estimator would."""
    disturbed = State(pose, 1.0).moved(np.append(step, 0.0), camera).pose
    return latitude_longitude(body_points(disturbed, camera, BODY, xy))


def scatter_of(pose, xy, covariance, count, camera=CAMERA):
    """RMS deviation (2, n) of latitude and longitude over random poses, in pairs of opposite steps, about the
    undisturbed ones; the steps are made to have exactly this covariance, so that few will do."""
    half = np.random.default_rng(3).normal(size=(count // 2, len(covariance)))
    half = half @ np.linalg.inv(np.linalg.cholesky(half.T @ half / len(half))).T
    half = half @ np.linalg.cholesky(covariance).T
    base = np.array(coordinates(pose, xy, np.zeros(7), camera))
    samples = np.array([coordinates(pose, xy, step, camera) for step in (*half, *-half)]) - base
    return np.sqrt(np.nanmean(((samples + 180) % 360 - 180) ** 2, axis=0)), np.isfinite(samples).all(axis=(0, 1))


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
        step = np.zeros(7)
        step[i] = {"off": 1e-3, "ran": 1e-6, "rol": 1e-4, "att": 1e-4}[name[:3]]
        plus, minus = (coordinates(pose, xy, sign * step) for sign in (1, -1))
        for analytic, p, m in zip(jacobian, plus, minus, strict=True):
            numeric = ((p - m + 180) % 360 - 180) / (2 * step[i])
            scale = max(1e-6, np.abs(numeric[away_from_poles]).max())
            assert np.abs(analytic[i] - numeric)[away_from_poles].max() < 1e-4 * scale, name


def joint_covariance(kind):
    """Covariances (7, 7) as the joint step states them: sigmas, and the correlations that a disk leaves."""
    sigma = np.array([0.05, 0.03, 3e-4, 0.3, 0.16, 0.15, 0.2])
    correlation = np.eye(7)
    pairs = {"correlated": {(0, 2): 0.8, (1, 2): -0.4, (3, 4): 0.5, (3, 6): -0.7, (0, 5): 0.6, (1, 4): -0.5}}
    for (a, b), r in pairs.get(kind, {}).items():
        correlation[a, b] = correlation[b, a] = r
    values, vectors = np.linalg.eigh(correlation)
    correlation = vectors * np.maximum(values, 0.01) @ vectors.T
    return correlation * np.outer(sigma, sigma)


@pytest.mark.parametrize("kind", ["independent", "correlated"])
@pytest.mark.parametrize("wide", [False, True], ids=["narrow", "wide"])
@pytest.mark.parametrize("turn", [(20.0, 50.0, -70.0)])
def test_sigmas_are_the_scatter_of_random_poses(kind, wide, turn):
    """Within 3 % up to a pixel from the limb: of a narrow field, and of a wide one far from its boresight."""
    camera, pose = CAMERA, pose_of(turn)
    if wide:
        camera = Camera(name="wide", size_px=(400, 400), centre_px=(-120.0, 20.0), focal_length_px=600.0)
        to_target = pose.camera_from_j2000.T @ (camera.ray([230.0, 150.0]) * 1.2e4)
        pose = pose.replaced(target_from_spacecraft_km=to_target)
    centre = camera.project(pose.target_in_camera_km)
    edge = limb_points(pose, camera, BODY, 48)
    away = np.linalg.norm(edge - centre, axis=1)[:, None]
    inside = np.concatenate(
        [centre + (edge - centre) * f for f in (0.1, 0.5, 0.8, 0.95)] + [centre + (edge - centre) * (1 - 1 / away)]
    )
    points = body_points(pose, camera, BODY, inside).T
    covariance = joint_covariance(kind)
    found = np.array(coordinate_sigmas(pose, camera, BODY, PoseUncertainty(covariance), points))
    seen, always = scatter_of(pose, inside, covariance, 400, camera)
    latitude = np.abs(latitude_longitude(points.T)[0])
    steady = always & (latitude < 80) & (found < 2).all(axis=0)
    assert steady.sum() > 80
    worst = np.abs(found / seen - 1)[:, steady].max(axis=1)
    print(worst)
    assert (worst < 0.03).all()


def test_a_longitude_at_the_pole_is_no_more_uncertain_than_one_that_may_be_any():
    pose = pose_of()
    pole = BODY.radii_km[2] * np.array([[0.0, 0.0, 1.0]])
    side = 1.0 if pose.spacecraft_in_body_km[2] > 0 else -1.0
    points = (side * pole + [[1e-3, 0, 0]]).T
    uncertainty = PoseUncertainty.from_sigmas({"offset_px": [0.1, 0.1], "range_factor": 0, "attitude_deg": [0.1] * 3})
    _, longitude = coordinate_sigmas(pose, CAMERA, BODY, uncertainty, points)
    assert longitude == pytest.approx(180 / np.sqrt(3))


def test_correlations_count():
    """Offsets in x and y that are always the same add like numbers, not like independent errors."""
    pose = pose_of()
    xy = grid_on_disk(pose, 0.3)
    covariance = np.zeros((7, 7))
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
    base = coordinates(pose, xy, np.zeros(7))
    samples = np.array([coordinates(pose, xy + step, np.zeros(7)) for step in steps]) - np.array(base)
    scatter = np.sqrt(np.nanmean(((samples + 180) % 360 - 180) ** 2, axis=0))
    steady = np.abs(base[0]) < 75
    for sigma, seen in zip(found, scatter, strict=True):
        assert np.abs(sigma / seen - 1)[steady].max() < 0.12


def test_unknown_parts_are_listed_and_wrong_ones_refused():
    known = PoseUncertainty.from_sigmas({"offset_px": [0.1, 0.1], "range_factor": None})
    assert known.not_included == ("range_factor", "attitude_deg")
    with pytest.raises(ValueError, match="offset_px must be 2"):
        PoseUncertainty.from_sigmas({"offset_px": [0.1]})
    with pytest.raises(ValueError, match=r"\(7, 7\)"):
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


def test_what_steps_state_last_counts_with_its_correlations_and_what_a_later_step_says_without():
    joint = joint_covariance("correlated")
    names = ["x", "y", "range", "roll", "attitude_x", "attitude_y", "attitude_z", "psf"]
    whole = np.zeros((8, 8))
    whole[:7, :7], whole[7, 7] = joint, 0.01
    sigma = np.sqrt(np.diag(joint))
    first = {"uncertainty": {"offset_px": [9.0, 9.0], "attitude_deg": None}, "evidence": {}}
    last = {
        "uncertainty": {
            "offset_px": sigma[:2].tolist(), "range_factor": sigma[2], "roll_deg": sigma[3],
            "attitude_deg": sigma[4:].tolist(), "psf_sigma_px": 0.1, "range_factor_free": 1.0,
        },
        "evidence": {"unknowns": names, "covariance": whole.tolist(), "map_frame_deg": 0.14},
    }  # fmt: skip
    found = stated_uncertainty({"point-1": first, "joint-1": last})
    assert np.array_equal(found.covariance, joint)
    assert (found.not_included, found.map_frame_deg) == ((), 0.14)
    assert np.allclose(found.without_map_frame.covariance + found.of_map_frame.covariance, joint)
    later = stated_uncertainty({"joint-1": last, "point-2": {"uncertainty": {"offset_px": [0.3, 0.4]}, "evidence": {}}})
    assert np.allclose(later.covariance[:2, :2], np.diag([0.09, 0.16]))
    assert not later.covariance[:2, 2:].any()
    assert np.array_equal(later.covariance[2:, 2:], joint[2:, 2:])
    held = {"uncertainty": last["uncertainty"] | {"attitude_deg": None}, "evidence": last["evidence"]}
    assert stated_uncertainty({"joint-1": held}).not_included == ("attitude_deg",)
    assert stated_uncertainty({"joint-1": held}).map_frame_deg == 0
    assert PoseUncertainty.from_dict(found.to_dict()).to_dict() == found.to_dict()
