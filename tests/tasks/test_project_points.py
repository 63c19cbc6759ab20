"""Surface points, limb, terminator and grid of random triaxial bodies seen from anywhere, against SPICE."""

import numpy as np
import pytest
import spiceypy
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from catalog.camera import Camera
from catalog.errors import RefusedError
from catalog.pose import Pose
from catalog.target import Target
from tasks.project.curves import graticule, limb, limb_points, terminator
from tasks.project.points import (
    body_points,
    illuminated,
    latitude_longitude,
    pixels_of_points,
    surface_points,
    visible,
)

CAMERA = Camera(name="test", size_px=(1024, 800), centre_px=(510.3, 401.7), focal_length_px=1e5)


def pose_seeing(range_km, rotations, offset_px, sun_direction, camera=CAMERA):
    """The target's centre `offset_px` from the optical centre, its body turned by a random rotation."""
    camera_from_j2000, body_from_j2000 = (Rotation.from_rotvec(r).as_matrix() for r in rotations)
    centre = camera.ray(np.asarray(camera.centre_px) + offset_px)
    sun = np.asarray(sun_direction) / np.linalg.norm(sun_direction) * 7e8
    return Pose(0.0, camera_from_j2000, camera_from_j2000.T @ centre * range_km, sun, body_from_j2000)


def vectors(bound):
    return st.tuples(*[st.floats(-bound, bound)] * 3)


@st.composite
def scenes(draw):
    """A triaxial body between 3 and 400 px of radius, its centre up to 300 px off the axis."""
    radii = tuple(draw(st.floats(0.4, 1.0)) * draw(st.sampled_from([2000.0, 200.0])) for _ in range(3))
    radius_px = draw(st.floats(3.0, 400.0))
    range_km = max(radii) * CAMERA.focal_length_px / radius_px
    sun = draw(vectors(1.0).filter(lambda v: np.linalg.norm(v) > 0.1))
    offset = np.array(draw(st.tuples(*[st.floats(-300, 300)] * 2)))
    pose = pose_seeing(range_km, (draw(vectors(3.0)), draw(vectors(3.0))), offset, sun)
    return pose, Target(name="Body", naif_id=1, radii_km=radii)


def pixels_on_disk(pose, target, margin=1e-9, n=60):
    """Pixels from the disk's centre to just inside the limb."""
    centre = CAMERA.project(pose.target_in_camera_km)
    edge = limb_points(pose, CAMERA, target, n)
    fraction = 1.0 - np.concatenate([np.geomspace(1.0, margin, 15), [0.5, 0.3]])[:, None, None]
    return (centre + fraction * (edge - centre)).reshape(-1, 2)


@given(scenes())
@settings(max_examples=60, deadline=None)
def test_points_lie_on_the_ellipsoid_and_project_back_to_their_pixel(scene):
    pose, target = scene
    xy = pixels_on_disk(pose, target)
    points = body_points(pose, CAMERA, target, xy)
    assert np.isfinite(points).all()
    assert np.abs(np.sum((points / target.radii_km) ** 2, axis=-1) - 1).max() < 1e-9
    assert np.abs(pixels_of_points(pose, CAMERA, points) - xy).max() < 1e-6
    assert visible(pose, target, points).mean() > 0.99


@given(scenes())
@settings(max_examples=25, deadline=None)
def test_points_and_coordinates_agree_with_spice_to_the_limb(scene):
    pose, target = scene
    spacecraft = np.array(pose.spacecraft_in_body_km)
    xy = pixels_on_disk(pose, target, margin=1e-5, n=12)
    points = body_points(pose, CAMERA, target, xy)
    latitude, longitude = latitude_longitude(points)
    for pixel, point, lat, lon in zip(xy, points, latitude, longitude, strict=True):
        ray = pose.camera_from_body.T @ CAMERA.ray(pixel)
        expected = spiceypy.surfpt(spacecraft, ray, *target.radii_km)
        _, spice_lon, spice_lat = spiceypy.reclat(expected)
        step_deg = np.degrees(np.linalg.norm(expected - point) / min(target.radii_km))
        bar_deg = 1e-6 if pose.range_km < 1e5 * min(target.radii_km) else 1e-5  # beyond, SURFPT loses digits
        assert step_deg < bar_deg
        assert abs(lat - np.degrees(spice_lat)) < bar_deg
        assert abs((lon - np.degrees(spice_lon) + 180) % 360 - 180) * np.cos(spice_lat) < bar_deg


def test_the_limb_is_where_lines_of_sight_begin_to_miss():
    target = Target(name="Body", naif_id=1, radii_km=(1562.6, 1560.3, 1200.0))
    pose = pose_seeing(4e6, ((0.3, 1, -2), (1, 0.2, 0.5)), np.array([40, -30.0]), (1, 2, 0.5))
    centre = CAMERA.project(pose.target_in_camera_km)
    edge = limb_points(pose, CAMERA, target, 360)
    inside, outside = (centre + (edge - centre) * (1 + d) for d in (-1e-9, 1e-9))
    assert np.isfinite(body_points(pose, CAMERA, target, inside)).all()
    assert np.isnan(body_points(pose, CAMERA, target, outside)).all()


def test_a_grazing_point_is_as_exact_as_extended_precision():
    """At 4e6 km and 1e-7 of the radius inside the limb, against the plain quadratic in 80-bit floats."""
    target = Target(name="Body", naif_id=1, radii_km=(1562.6, 1560.3, 1559.5))
    pose = pose_seeing(4e6, ((0.3, 1, -2), (1, 0.2, 0.5)), np.array([200, -130.0]), (1, 2, 0.5))
    xy = pixels_on_disk(pose, target, margin=1e-7)
    long = np.longdouble
    radii, rotation = np.array(target.radii_km, long), pose.camera_from_j2000.astype(long)
    body = pose.body_from_j2000.astype(long)
    s = -(body @ pose.target_from_spacecraft_km.astype(long)) / radii
    offset = (xy.astype(long) - np.array(CAMERA.centre_px, long)) / long(CAMERA.focal_length_px)
    ray = np.concatenate([offset, np.ones((len(xy), 1), long)], axis=1) @ rotation @ body.T / radii
    a, b, c = (ray**2).sum(1), ray @ s, s @ s - 1
    expected = (s + ((-b - np.sqrt(b * b - a * c)) / a)[:, None] * ray) * radii
    error_deg = np.degrees(
        np.linalg.norm((body_points(pose, CAMERA, target, xy) - expected).astype(float), axis=1) / 1560
    )
    print(f"largest error {error_deg.max():.1e} deg of arc, bar 1e-6")
    assert error_deg.max() < 1e-6


def test_a_target_beside_or_behind_the_camera_is_not_seen_but_a_close_surface_is():
    target = Target(name="Body", naif_id=1, radii_km=(1000.0, 900.0, 800.0))
    wide = Camera(name="wide", size_px=(100, 100), centre_px=(49.5, 49.5), focal_length_px=50.0)
    sun = np.array([7e8, 0, 0])
    behind = Pose(0.0, np.eye(3), np.array([0, 0, -5000.0]), sun, np.eye(3))
    grid = np.stack(np.meshgrid(np.arange(100.0), np.arange(100.0)), axis=-1)
    assert np.isnan(body_points(behind, wide, target, grid)).all()
    assert np.isnan(limb_points(behind, wide, target)).all()
    beside = behind.replaced(target_from_spacecraft_km=np.array([1010.0, 0, 0]))
    points = body_points(beside, wide, target, grid)
    seen = np.isfinite(points[..., 0])
    assert 0.2 < seen.mean() < 0.9
    assert np.abs(pixels_of_points(beside, wide, points)[seen] - grid[seen]).max() < 1e-9
    assert np.abs(np.sum((points[seen] / target.radii_km) ** 2, axis=-1) - 1).max() < 1e-9


@given(scenes())
@settings(max_examples=30, deadline=None)
def test_limb_and_terminator_are_edges_of_sight_and_of_light(scene):
    pose, target = scene
    radii = np.asarray(target.radii_km)
    sun = pose.body_from_j2000 @ pose.sun_from_target_km
    for curve, viewpoint in (
        (limb(pose, CAMERA, target, 90), pose.spacecraft_in_body_km),
        (terminator(pose, CAMERA, target, 90), sun),
    ):
        normal = curve.points_km / radii**2
        to_viewpoint = viewpoint - curve.points_km
        cosine = np.sum(normal * to_viewpoint, axis=1) / np.linalg.norm(normal, axis=1)
        assert np.abs(cosine / np.linalg.norm(to_viewpoint, axis=1)).max() < 1e-9
        assert np.abs(np.sum((curve.points_km / radii) ** 2, axis=1) - 1).max() < 1e-12


@given(scenes())
@settings(max_examples=30, deadline=None)
def test_visible_grid_points_are_found_again_at_their_pixels(scene):
    pose, target = scene
    for line in graticule(pose, CAMERA, target, n=31):
        name, value = line.name.split()
        clear = visible(pose, target, line.points_km * 0.999)  # not on the very limb
        seen = body_points(pose, CAMERA, target, line.xy_px[clear])
        assert np.allclose(seen, line.points_km[clear], atol=1e-4 * min(target.radii_km))
        latitude, longitude = latitude_longitude(line.points_km[1:-1])
        off = latitude - float(value) if name == "latitude" else (longitude - float(value) + 180) % 360 - 180
        assert np.abs(off).max() < 1e-9
        assert np.isnan(line.visible_xy_px[~line.visible]).all()


def test_the_limb_is_lit_on_the_side_of_the_sun():
    target = Target(name="Body", naif_id=1, radii_km=(1000.0, 1000.0, 1000.0))
    pose = Pose(0.0, np.eye(3), np.array([0, 0, 5e5]), np.array([7e8, 0, 0]), np.eye(3))
    edge = limb(pose, CAMERA, target, 360)
    assert edge.illuminated[edge.xy_px[:, 0] > CAMERA.centre_px[0] + 5].all()
    assert not edge.illuminated[edge.xy_px[:, 0] < CAMERA.centre_px[0] - 5].any()
    sub_solar = surface_points(target, 0.0, 0.0)
    assert illuminated(pose, target, sub_solar)
    assert not illuminated(pose, target, -sub_solar)


def test_a_spacecraft_or_a_sun_inside_the_target_is_refused():
    target = Target(name="Body", naif_id=1, radii_km=(1000.0, 1000.0, 1000.0))
    pose = Pose(0.0, np.eye(3), np.array([0, 0, 900.0]), np.array([7e8, 0, 0]), np.eye(3))
    with pytest.raises(RefusedError, match="inside the body"):
        body_points(pose, CAMERA, target, [10.0, 10.0])
    unit_sun = pose.replaced(target_from_spacecraft_km=np.array([0, 0, 5e5]), sun_from_target_km=np.array([1.0, 0, 0]))
    with pytest.raises(RefusedError, match="not a unit vector"):
        terminator(unit_sun, CAMERA, target)
