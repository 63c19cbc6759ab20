"""The planes beyond the cube's own, against SPICE and against finite steps on the surface."""

import numpy as np
import pytest
import spiceypy
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from catalog.camera import Camera
from catalog.errors import RefusedError
from catalog.pose import Pose
from catalog.target import Target, find_target
from tasks.project.more_planes import ADDED_PLANES, MORE_PLANES, more_planes, planes_named
from tasks.project.pixels import project_pixels, seen_at
from tasks.project.points import pixels_of_points

CAMERA = Camera(name="test", size_px=(90, 70), centre_px=(44.2, 35.9), focal_length_px=5e4)


def scene(turn, radii, radius_px=25.0, offset=(3.0, -2.0)):
    camera_from_j2000, body_from_j2000 = Rotation.from_rotvec([(0.3, 1, -2), turn]).as_matrix()
    centre = CAMERA.ray(np.asarray(CAMERA.centre_px) + offset)
    to_target = camera_from_j2000.T @ centre * (max(radii) * CAMERA.focal_length_px / radius_px)
    target = Target(name="Body", naif_id=599, radii_km=radii, rotation=find_target("jupiter").rotation)
    return Pose(0.0, camera_from_j2000, to_target, (5e8, 4e8, -2e8), body_from_j2000), target


def grid():
    return np.stack(np.meshgrid(np.arange(0, 90, 3), np.arange(0, 70, 3)), axis=-1).astype(float)


turns = st.tuples(*[st.floats(-3, 3)] * 3)
radius = st.floats(700.0, 1500.0)


@given(turns, st.tuples(radius, radius, radius))
@settings(max_examples=25, deadline=None)
def test_limb_distances_are_spices(turn, radii):
    pose, target = scene(turn, radii)
    xy = grid().reshape(-1, 2)[::7]
    ours = more_planes(pose, CAMERA, target, xy, ("limb_distance_km",))["limb_distance_km"]
    spacecraft, rays = pose.spacecraft_in_body_km, CAMERA.ray(xy) @ pose.camera_from_body
    for distance, ray in zip(ours, rays, strict=True):
        if np.isfinite(distance):
            _, expected = spiceypy.npedln(*radii, spacecraft, ray)
            assert distance == pytest.approx(expected, abs=1e-5)  # SPICE's own tolerance at this range


@given(turns, radius, radius)
@settings(max_examples=15, deadline=None)
def test_planetographic_coordinates_are_spices(turn, equatorial, polar):
    pose, target = scene(turn, (equatorial, equatorial, polar))
    on_body, seen = seen_at(pose, CAMERA, target, grid())
    planes = more_planes(pose, CAMERA, target, grid(), ("latitude_graphic", "longitude_graphic"))
    for point, lat, lon in zip(seen.points_km[::5], *(planes[n][on_body][::5] for n in planes), strict=True):
        graphic = spiceypy.recgeo(point, equatorial, (equatorial - polar) / equatorial)[1]
        assert abs(lat - np.degrees(graphic)) < 1e-6
        west = -np.degrees(np.arctan2(point[1], point[0]))  # Jupiter turns eastward: west longitudes
        assert abs((lon - west + 180) % 360 - 180) < 1e-9


def test_longitudes_and_local_time_are_of_one_mind():
    pose, target = scene((1, 0.2, 0.5), (1500.0, 1400.0, 1300.0))
    planes = more_planes(pose, CAMERA, target, grid())
    east = project_pixels(pose, CAMERA, target, grid(), ("longitude",))["longitude"]
    on_body = np.isfinite(east)
    assert set(planes) == set(MORE_PLANES)
    assert np.allclose((planes["longitude_west"] + east)[on_body] % 360, 0, atol=1e-9)
    assert np.isin((planes["longitude_180"] - east)[on_body], [0.0, -360.0]).all()
    assert planes["longitude_180"][on_body].min() >= -180
    sun = pose.body_from_j2000 @ pose.sun_from_target_km
    noon = np.degrees(np.arctan2(sun[1], sun[0]))
    hours = (planes["local_solar_time"] - 12) * 15 - (east - noon)
    assert np.allclose((hours[on_body] + 180) % 360 - 180, 0, atol=1e-9)
    incidence = project_pixels(pose, CAMERA, target, grid(), ("incidence",))["incidence"]
    assert np.array_equal(planes["shadow"][on_body] == 1, incidence[on_body] >= 90)


def test_image_azimuths_are_where_a_step_on_the_surface_goes():
    pose, target = scene((1, 0.2, 0.5), (1500.0, 1500.0, 1500.0))
    names = ("north_azimuth", "sun_azimuth", "spacecraft_azimuth")
    on_body, seen = seen_at(pose, CAMERA, target, grid())
    planes = more_planes(pose, CAMERA, target, grid(), names)
    sun = pose.body_from_j2000 @ pose.sun_from_target_km
    towards = {
        "north_azimuth": np.array([0, 0, 1.0]),
        "sun_azimuth": sun,
        "spacecraft_azimuth": pose.spacecraft_in_body_km,
    }
    here = pixels_of_points(pose, CAMERA, seen.points_km)
    for name, goal in towards.items():
        step = seen.points_km + 1e-4 * (goal / np.linalg.norm(goal) * 1500.0 - seen.points_km)
        step *= 1500.0 / np.linalg.norm(step, axis=1, keepdims=True)
        dx, dy = (pixels_of_points(pose, CAMERA, step) - here).T
        off = (planes[name][on_body] - np.degrees(np.arctan2(dy, dx)) + 180) % 360 - 180
        clear = np.hypot(dx, dy) > 1e-4
        assert np.abs(off[clear]).max() < 0.1, name
    toward_centre = CAMERA.project(pose.target_in_camera_km) - grid()[on_body]
    clear = np.hypot(*toward_centre.T) > 3
    off = planes["spacecraft_azimuth"][on_body] - np.degrees(np.arctan2(toward_centre[:, 1], toward_centre[:, 0]))
    assert np.abs((off[clear] + 180) % 360 - 180).max() < 0.1  # the sub-spacecraft point is the disk's middle


def test_ground_azimuths_lead_to_their_points():
    pose, target = scene((1, 0.2, 0.5), (1500.0, 1500.0, 1500.0))
    on_body, seen = seen_at(pose, CAMERA, target, grid())
    planes = more_planes(pose, CAMERA, target, grid(), ("sun_ground_azimuth", "spacecraft_ground_azimuth"))
    east = np.cross([0, 0, 1.0], seen.points_km)
    east /= np.linalg.norm(east, axis=1, keepdims=True)
    north = np.cross(seen.points_km, east) / 1500.0
    goals = (pose.body_from_j2000 @ pose.sun_from_target_km, pose.spacecraft_in_body_km)
    for values, goal in zip(planes.values(), goals, strict=True):
        expected = np.degrees(np.arctan2(east @ goal, north @ goal))
        assert np.abs((values[on_body] - expected + 180) % 360 - 180).max() < 1e-9


def test_sky_directions_are_the_cameras_everywhere():
    pose, target = scene((1, 0.2, 0.5), (1500.0, 1400.0, 1300.0))
    planes = more_planes(pose, CAMERA, target, grid(), ("right_ascension", "declination", "limb_distance_km"))
    _, ra, dec = np.array([spiceypy.recrad(v) for v in CAMERA.ray(grid().reshape(-1, 2)) @ pose.camera_from_j2000]).T
    assert np.allclose(planes["right_ascension"].ravel(), np.degrees(ra), atol=1e-9)
    assert np.allclose(planes["declination"].ravel(), np.degrees(dec), atol=1e-9)
    on_body, _ = seen_at(pose, CAMERA, target, grid())
    assert np.array_equal(np.isfinite(planes["limb_distance_km"]), ~on_body)


def test_names_of_planes_are_checked():
    assert planes_named("all") == tuple(ADDED_PLANES)
    assert planes_named("shadow, declination") == ("shadow", "declination")
    with pytest.raises(RefusedError, match=r"no plane .colour.*Known are latitude_graphic"):
        planes_named("shadow,colour")
