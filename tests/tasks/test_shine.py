"""Light of other bodies on the target, against patches of a sphere that are summed one by one (`lab.bodies.caster`)."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import dblquad

from catalog.basemap import uniform_map
from catalog.camera import Camera
from catalog.placed_body import PlacedBody
from catalog.pose import Pose
from catalog.rotation import rotation_from_vector_deg
from catalog.target import Target
from lab.bodies.caster import Globe, cast, lamps_of
from lab.honesty.caster import View
from lab.honesty.solids import Solid
from tasks.bodies.placed import relevant
from tasks.simulate import Scene, SceneSettings
from tasks.simulate.others import OtherBodiesSettings
from tasks.simulate.shine import shine_of, shines_of

CAMERA = Camera(name="night", size_px=(90, 80), centre_px=(44.5, 39.5), focal_length_px=60_000.0, psf_sigma_px=0.0)
TARGET = Target(name="moon", naif_id=1, radii_km=(1000.0, 980.0, 960.0))
RADIUS_KM, ALBEDO = 70_000.0, 0.5
ALL = OtherBodiesSettings(least_shine=1e-12, least_night=0.0)


def frame_of(
    distance_radii: float, phase_of_planet_deg: float, phase_deg: float = 130.0, side_deg: float = 20.0
) -> Pose:
    """A moon 2e6 km away on the boresight; the planet stands behind the spacecraft, off the line of sight."""
    to_planet = rotation_from_vector_deg([side_deg, 0.0, 0.0]) @ np.array([0.0, 0.0, -1.0])
    away = distance_radii * RADIUS_KM * to_planet
    sun = rotation_from_vector_deg([0.0, phase_deg, 0.0]) @ np.array([0.0, 0.0, -1.0]) * 7.8e8
    if phase_of_planet_deg >= 0:
        turned = rotation_from_vector_deg(phase_of_planet_deg * np.array([0.0, 1.0, 0.0])) @ -to_planet
        sun = turned * 7.8e8
    planet = PlacedBody(
        name="planet", naif_id=5, radii_km=(RADIUS_KM,) * 3, from_target_km=tuple(away),
        sun_from_body_km=tuple(sun - away), geometric_albedo=ALBEDO,
    )  # fmt: skip
    return Pose(
        2e8, np.eye(3), np.array([0, 0, 2e6]), sun, rotation_from_vector_deg([10.0, 20.0, 30.0]), bodies=(planet,)
    )


@pytest.mark.parametrize("phase_deg", [0.0, 30.0, 90.0, 120.0])
def test_the_light_of_a_far_planet_is_that_of_the_published_formula(phase_deg: float) -> None:
    """Russell 1916 for the light, Lindegren 1977 for where it seems to come from."""
    pose = frame_of(1000.0, phase_deg)
    away, sun = np.array(pose.bodies[0].from_target_km), np.array(pose.bodies[0].sun_from_body_km)
    a = np.arccos(-(away @ sun) / np.linalg.norm(away) / np.linalg.norm(sun))
    light = np.sin(a) + (np.pi - a) * np.cos(a)
    shine = shine_of(pose.bodies[0], pose, TARGET)
    nearer = (pose.sun_from_target_km @ pose.sun_from_target_km) / (sun @ sun)
    assert shine.share == pytest.approx(ALBEDO * light / np.pi / 1000.0**2 * nearer, rel=0.01)
    beside = 3 * np.pi / 16 * np.sin(a) * (1 + np.cos(a)) / light / 1000.0
    off = np.arccos(shine.direction @ pose.body_from_j2000 @ away / np.linalg.norm(away))
    assert off == pytest.approx(beside, abs=2e-5)


@pytest.mark.parametrize(("distance_radii", "phase_deg"), [(2.6, 60.0), (5.9, 10.0), (5.9, 110.0)])
def test_the_light_of_a_planet_is_that_of_its_patches(distance_radii: float, phase_deg: float) -> None:
    """By scipy's integration over longitude and latitude, about the axis to the moon."""
    pose = frame_of(distance_radii, phase_deg)
    away, sun = np.array(pose.bodies[0].from_target_km), np.array(pose.bodies[0].sun_from_body_km)
    axis, towards = -away / np.linalg.norm(away), sun / np.linalg.norm(sun)
    across = towards - (towards @ axis) * axis
    across /= np.linalg.norm(across)
    d, cosine, sine = distance_radii, towards @ axis, towards @ across

    def patch(around: float, mu: float, part: int) -> float:
        out = np.sqrt(1 - mu**2)
        lit = max(mu * cosine + out * np.cos(around) * sine, 0.0)
        line = np.array([mu - d, out * np.cos(around)])  # from the moon, along the axis and across
        square = d**2 - 2 * d * mu + 1
        seen = (d * mu - 1) / np.sqrt(square)
        return 1.5 * ALBEDO / np.pi * lit * seen / square * line[part] / np.sqrt(square)

    along, beside = (
        dblquad(patch, 1 / d, 1, 0, 2 * np.pi, args=(part,), epsabs=1e-6, epsrel=1e-3)[0] for part in (0, 1)
    )
    nearer = (pose.sun_from_target_km @ pose.sun_from_target_km) / (sun @ sun)
    vector = (along * axis + beside * across) * nearer
    shine = shine_of(pose.bodies[0], pose, TARGET)
    assert shine.share == pytest.approx(np.linalg.norm(vector), rel=0.02)
    assert np.degrees(np.arccos(shine.direction @ pose.body_from_j2000 @ vector / np.linalg.norm(vector))) < 0.3


@pytest.mark.parametrize("law", ["lambert", "lommel-seeliger", "lunar-lambert"])
def test_the_night_side_looks_as_the_ray_caster_has_it(law: str) -> None:
    pose = frame_of(5.9, -1.0)
    place = pose.bodies[0]
    scene = Scene(CAMERA, TARGET, uniform_map(), SceneSettings(photometry=law, oversample=3))
    seen = scene.render(pose, scene.window(pose))
    solid = Solid(pose.target_from_spacecraft_km, np.array(TARGET.radii_km), pose.body_from_j2000, law)
    planet = Globe(5, Solid(pose.target_from_spacecraft_km + place.offset_km, np.array(place.radii_km), np.eye(3)))
    sun = pose.target_from_spacecraft_km + pose.sun_from_target_km
    lamps = lamps_of(planet, ALBEDO, pose.target_from_spacecraft_km, sun, 600)
    window = seen.window
    view = View(np.eye(3), CAMERA.focal_length_px, CAMERA.centre_px, window.x0, window.y0, *window.shape[::-1], 1)
    rays = view.rays(0, window.shape[0])
    true, dark = (
        cast(rays, [Globe(1, solid), planet], sun, lamps=each).radiance.reshape(window.shape) for each in (lamps, None)
    )
    night = (dark == 0) & (seen.coverage > 0.999) & (seen.lit == 0)
    # The caster's laws are one for mu0 = mu = 1 as ours are, up to a factor that sunlight has as well.
    day = (seen.lit > 0.999) & (dark > 0.05)
    factor = np.median(seen.shading[0][day] / true[day])
    assert night.sum() > 300
    off = np.abs(seen.shading[0] / factor - true)[night] / true[night].max()
    assert np.percentile(off, 95) < 0.03
    assert off.max() < 0.08  # beside the limb, where the laws are steep and the sub-pixels others


def test_a_frame_of_one_body_is_what_it_was_and_faint_or_drowned_light_is_left_out() -> None:
    pose = frame_of(5.9, -1.0)
    scene = Scene(CAMERA, TARGET, uniform_map(), SceneSettings(oversample=2))
    alone = scene.render(pose.replaced(bodies=()))
    off = scene.settings.model_copy(update={"others": OtherBodiesSettings(least_shine=0.5)})
    assert shines_of(pose.replaced(bodies=()), TARGET, ALL) == []
    assert np.array_equal(replace(scene, settings=off).render(pose).bases, alone.bases)
    lit = scene.render(pose)
    assert (lit.bases > alone.bases).any()
    assert np.array_equal(lit.lit, alone.lit)
    by_day = frame_of(5.9, -1.0, phase_deg=40.0)
    assert shines_of(by_day, TARGET, ALL)
    assert shines_of(by_day, TARGET, OtherBodiesSettings()) == []


def test_a_planet_behind_the_camera_matters_where_it_lights_the_night() -> None:
    pose, by_day = frame_of(5.9, -1.0), frame_of(5.9, -1.0, phase_deg=40.0)
    none = pose.replaced(bodies=())
    assert relevant(none, CAMERA, TARGET, pose.bodies) == list(pose.bodies)
    assert relevant(by_day.replaced(bodies=()), CAMERA, TARGET, by_day.bodies) == []
    assert relevant(none, CAMERA, TARGET, pose.bodies, OtherBodiesSettings(least_shine=0.5)) == []
