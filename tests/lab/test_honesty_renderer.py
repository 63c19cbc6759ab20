"""The benchmark's own renderer against SPICE, against closed forms, and for bias: it is used as truth."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from catalog.camera import Camera
from catalog.pose import Pose
from catalog.spice import kernel_pool
from catalog.target import Target
from lab.benchmark.spice_oracle import project_with_spice, write_kernels
from lab.honesty.caster import View, cast, met, rays_of, render
from lab.honesty.geometry import (
    Geometry,
    planted_errors,
    predicted_geometry,
    seen_geometry,
    seen_place_px,
    true_geometry,
)
from lab.honesty.laws import LAWS, radiance
from lab.honesty.optics import Blur, Detector, bending, blurred
from lab.honesty.picture import expose, light_of
from lab.honesty.scene import FOCAL_SIGMA, LENSES, Other, Scene
from lab.honesty.solids import (
    Solid,
    Terrain,
    even_directions,
    random_relief,
    random_terrain,
    sample,
    sphere_noise,
)

RADII_KM = np.array([207.8, 196.7, 190.6])
HAPKE = {"w": 0.7, "b": -0.3, "b0": 0.5, "h": 0.05, "roughness_deg": 20.0}
PARAMETERS: dict[str, dict[str, float]] = {"minnaert": {"k": 0.65}, "hapke": HAPKE}
CENTRE = (31.5, 31.5)
FOCAL = 100_000.0


def geometry(phase_deg: float = 50.0, seed: int = 3, **changes: Any) -> Geometry:
    """A body of the radii above, 22 px wide in radius, in a frame of 64 px."""
    scene = Scene("test", "test", seed, target="mimas", frame_px=64, radius_px=22.0, phase_deg=phase_deg, **changes)
    true = true_geometry(scene)
    factor = LENSES[scene.lens].focal_px / FOCAL
    return replace(true, target_from_spacecraft_km=true.target_from_spacecraft_km / factor, focal_px=FOCAL)


def solid_of(true: Geometry, **fields: Any) -> Solid:
    return Solid(true.target_from_spacecraft_km, RADII_KM, true.body_from_j2000, **fields)


def view_of(true: Geometry, oversample: int = 4) -> View:
    return View(true.camera_from_j2000, true.focal_px, true.centre_px, 0, 0, 64, 64, oversample)


def centroid(light: np.ndarray) -> np.ndarray:
    y, x = np.indices(light.shape)
    return np.array([(light * x).sum(), (light * y).sum()]) / light.sum()


def test_points_and_angles_are_those_of_spice(tmp_path: Path) -> None:
    true = geometry(phase_deg=70.0)
    pose = Pose.from_dict(true.pose())
    camera = Camera(name="test", size_px=(64, 64), centre_px=true.centre_px, focal_length_px=FOCAL)
    target = Target(name="mimas", naif_id=601, radii_km=tuple(RADII_KM))
    xy = np.random.default_rng(0).uniform(5, 58, (400, 2))
    with kernel_pool([]):
        write_kernels(pose, target, tmp_path)
        with kernel_pool([tmp_path]):
            spice = project_with_spice(pose, camera, xy)
    rays = rays_of(true.camera_from_j2000, FOCAL, true.centre_px, *xy.T)
    hits = met(rays, solid_of(true))
    assert set(hits.rays) == set(np.flatnonzero(np.isfinite(spice[:, 0])))
    assert 100 < len(hits.rays) < 390
    p = hits.points_km
    to_sun = true.body_from_j2000 @ (true.sun_from_target_km / np.linalg.norm(true.sun_from_target_km))
    to_camera = -(rays[hits.rays] @ true.body_from_j2000.T)
    ours = np.degrees(
        [
            np.arcsin(p[:, 2] / np.linalg.norm(p, axis=1)),
            np.arctan2(p[:, 1], p[:, 0]) % (2 * np.pi),
            np.arccos(hits.normals @ to_sun),
            np.arccos((hits.normals * to_camera).sum(axis=1)),
            np.arccos(to_camera @ to_sun),
        ]
    ).T
    # The Sun is at 7.4e8 km in SPICE, at infinity here.
    off = ours - spice[hits.rays]
    off[:, 1] = (off[:, 1] + 180) % 360 - 180
    assert np.abs(off).max() < 5e-5
    field = texture_of(lambda latitude, longitude: 1 + 0.3 * np.sin(2 * longitude) * np.cos(latitude))
    latitude, longitude = np.radians(spice[hits.rays, 0]), np.radians(spice[hits.rays, 1])
    expected = 1 + 0.3 * np.sin(2 * longitude) * np.cos(latitude)
    np.testing.assert_allclose(sample(field, p), expected, atol=2e-4)


def texture_of(function: Any) -> np.ndarray:
    rows, columns = 360, 720
    latitude = np.radians(90 - (np.arange(rows) + 0.5) * 180 / rows)[:, None]
    longitude = np.radians((np.arange(columns) + 0.5) * 360 / columns)[None, :]
    return (function(latitude, longitude) * np.ones((rows, columns))).astype(np.float32)


def test_outline_is_the_limb_of_spice() -> None:
    import spiceypy

    true = geometry(seed=8)
    eye = -true.body_from_j2000 @ true.target_from_spacecraft_km
    limb = spiceypy.edlimb(*RADII_KM, eye)
    angle = np.linspace(0, 2 * np.pi, 2000, endpoint=False)[:, None]
    points = limb.center + np.cos(angle) * limb.semi_major + np.sin(angle) * limb.semi_minor
    v = (points @ true.body_from_j2000 + true.target_from_spacecraft_km) @ true.camera_from_j2000.T
    x, y = (v[:, :2] / v[:, 2:] * FOCAL + np.asarray(true.centre_px)).T
    cross = x * np.roll(y, -1) - np.roll(x, -1) * y
    area = cross.sum() / 2
    middle = [((c + np.roll(c, -1)) * cross).sum() / (6 * area) for c in (x, y)]
    # Lit from behind the camera, Lommel-Seeliger's disk is flat.
    lit = replace(true, sun_from_target_km=-true.target_from_spacecraft_km)
    light = blurred(render(view_of(lit), [solid_of(lit, law="lommel-seeliger")], lit.sun_from_target_km), Blur(0.8), 4)
    assert 2 * light.sum() == pytest.approx(abs(area), rel=1e-3)
    np.testing.assert_allclose(centroid(light), middle, atol=0.01)


@pytest.mark.parametrize("law", ["lambert", "lommel-seeliger"])
def test_no_bias_of_centre_or_size(law: str) -> None:
    """Full disks at forty places between pixels: their centroid is the projected centre, their light the same."""
    off, light = [], []
    for seed in range(40):
        true = geometry(seed=seed)
        lit = replace(true, sun_from_target_km=-true.target_from_spacecraft_km)
        sphere = Solid(lit.target_from_spacecraft_km, np.full(3, 200.0), lit.body_from_j2000, law)
        blur = Blur(0.8, wings=0.1, wings_px=2.0)
        picture = blurred(render(view_of(lit, 5), [sphere], lit.sun_from_target_km), blur, 5)
        off.append(centroid(picture) - lit.place_px())
        light.append(picture.sum())
    assert np.abs(np.mean(off, axis=0)).max() < 0.0015
    assert np.std(off, axis=0).max() < 0.005
    assert np.std(light) / np.mean(light) < 1e-3


@pytest.mark.parametrize("law", LAWS)
def test_laws_are_reciprocal_and_dark_at_night(law: str) -> None:
    """r(i, e) / cos i is the same with Sun and camera exchanged (Helmholtz)."""
    random = np.random.default_rng(1)
    mu0, mu = random.uniform(0.05, 1, (2, 500))
    psi = random.uniform(0.05, np.pi - 0.05, 500)
    g = np.arccos(mu0 * mu + np.sqrt((1 - mu0**2) * (1 - mu**2)) * np.cos(psi))
    there = radiance(law, PARAMETERS.get(law, {}), mu0, mu, g)
    back = radiance(law, PARAMETERS.get(law, {}), mu, mu0, g)
    np.testing.assert_allclose(there / mu0, back / mu, rtol=1e-6)
    assert (there > 0).all()
    assert radiance(law, PARAMETERS.get(law, {}), np.array([-0.1]), np.array([0.5]), np.array([1.0]))[0] == 0


def test_hapke_has_its_limits() -> None:
    mu0, mu, g = np.array([0.3, 0.7, 0.9]), np.array([0.8, 0.5, 0.95]), np.array([1.2, 0.9, 0.5])
    dark = {"w": 1e-4, "b": 0.0, "b0": 0.0, "h": 0.05, "roughness_deg": 0.0}
    np.testing.assert_allclose(radiance("hapke", dark, mu0, mu, g), 1e-4 / 4 * mu0 / (mu0 + mu), rtol=1e-3)
    smooth, nearly = (radiance("hapke", HAPKE | {"roughness_deg": d}, mu0, mu, g) for d in (0.0, 0.5))
    np.testing.assert_allclose(smooth, nearly, rtol=5e-3)

    # Roughness darkens at large phase angles, most near the terminator, and hardly at small ones: Hapke 1984.
    def darkening(mu0: float, mu: float, phase_deg: float) -> float:
        at = np.array([mu0]), np.array([mu]), np.array([np.radians(phase_deg)])
        return float(radiance("hapke", HAPKE, *at)[0] / radiance("hapke", HAPKE | {"roughness_deg": 0.0}, *at)[0])

    assert darkening(0.5, 0.5, 120.0) < 0.75 < 0.9 < darkening(0.95, 0.95, 5.0) < 1


def test_akimov_is_flat_at_full_phase() -> None:
    mu = np.linspace(0.05, 1, 50)
    np.testing.assert_allclose(radiance("akimov", {}, mu, mu, np.full(50, 1e-3)), 1, atol=2e-2)


@pytest.mark.parametrize(
    "blur",
    [
        Blur(0.55),
        Blur(1.2, wings=0.2, wings_px=5.0),
        Blur(0.8, moffat=2.5),
        Blur(0.8, ratio=1.25, smear_px=5.0, smear_deg=33.0),
        Blur(4.0, moffat=3.0),
    ],
)
def test_blur_moves_nothing(blur: Blur) -> None:
    kernel = blur.kernel(4)
    assert kernel.sum() == pytest.approx(1)
    np.testing.assert_allclose(kernel, kernel[::-1, ::-1], atol=1e-12)
    if blur.smear_px:
        y, x = np.indices(kernel.shape) - kernel.shape[0] // 2
        along = (x * np.cos(np.radians(33)) + y * np.sin(np.radians(33))) / 4
        across = (-x * np.sin(np.radians(33)) + y * np.cos(np.radians(33))) / 4
        spread = (kernel * along**2).sum() - (kernel * across**2).sum()
        core = (1 - 1.25**2) * 0.8**2 * np.cos(np.radians(66))  # the unequal axes lie along x and y
        assert spread == pytest.approx(5.0**2 / 12 + core, rel=0.02)


def test_moffat_has_the_core_s_width_at_half_maximum() -> None:
    kernel = Blur(2.0, moffat=2.5).kernel(10)
    middle = kernel.shape[0] // 2
    half = kernel[middle, middle] / 2
    assert kernel[middle, middle + 23] > half > kernel[middle, middle + 24]  # 2.355 px


def test_another_body_hides_and_its_shadow_is_dark() -> None:
    true = geometry(phase_deg=40.0)
    target, sun = solid_of(true), true.sun_from_target_km / np.linalg.norm(true.sun_from_target_km)
    ray = true.target_from_spacecraft_km / np.linalg.norm(true.target_from_spacecraft_km)
    bright = cast(ray[None], [target], sun)[0]
    point = met(ray[None], target).points_km[0] @ true.body_from_j2000 + true.target_from_spacecraft_km
    caster = Solid(point + 3000 * sun, np.full(3, 20.0), np.eye(3))
    beyond = replace(caster, centre_km=point - 3000 * sun)
    beside = replace(
        caster, centre_km=point + 3000 * sun + 21.0 * np.cross(sun, ray) / np.linalg.norm(np.cross(sun, ray))
    )
    assert bright > 0
    assert cast(ray[None], [target, caster], sun)[0] == 0
    assert cast(ray[None], [target, beyond], sun)[0] == bright
    assert cast(ray[None], [target, beside], sun)[0] == bright
    front = Solid(0.5 * true.target_from_spacecraft_km, np.full(3, 20.0), np.eye(3), brightness=0.5)
    behind = replace(front, centre_km=2 * true.target_from_spacecraft_km)
    assert cast(ray[None], [front, target], sun)[0] == cast(ray[None], [target, front], sun)[0] != bright
    assert cast(ray[None], [behind, target], sun)[0] == bright


def test_relief_has_no_mean_and_no_first_moment_and_is_met() -> None:
    relief = random_relief(np.random.default_rng(5), 0.05)
    u = even_directions(20_000)
    height = relief.height(u)
    assert abs(height.mean()) < 1e-4
    assert np.abs((height[:, None] * u).mean(axis=0)).max() < 1e-4
    assert height.std() == pytest.approx(0.05, rel=0.01)
    true = geometry()
    rough = solid_of(true, relief=relief)
    rays = view_of(true, 1).rays(0, 64)
    hits = met(rays, rough)
    length = np.linalg.norm(hits.points_km, axis=1)
    surface = 1 + relief.height(hits.points_km / length[:, None])
    np.testing.assert_allclose(np.linalg.norm(hits.points_km / RADII_KM, axis=1), surface, atol=1e-5)
    assert (hits.normals * (rays[hits.rays] @ true.body_from_j2000.T)).sum(axis=1).max() < 0.05
    flat = met(rays, solid_of(true, relief=random_relief(np.random.default_rng(5), 1e-9)))
    exact = met(rays, solid_of(true))
    np.testing.assert_array_equal(flat.rays, exact.rays)
    np.testing.assert_allclose(flat.points_km, exact.points_km, atol=0.05)


def test_terrain_is_beside_the_best_ellipsoid_as_rough_as_stated_and_is_met() -> None:
    terrain = random_terrain(np.random.default_rng(5), 0.004)
    u = even_directions(20_000)
    height, (x, y, z) = terrain.height(u), u.T
    low = np.stack([np.ones_like(x), x, y, z, x * y, x * z, y * z, x * x - y * y, 3 * z * z - 1], axis=1)
    assert np.abs((height[:, None] * low).mean(axis=0)).max() < 2e-5
    assert height.std() == pytest.approx(0.004, rel=0.03)
    true = geometry()
    rays = view_of(true, 1).rays(0, 64)
    hits = met(rays, solid_of(true, relief=terrain))
    surface = 1 + terrain.height(hits.points_km / np.linalg.norm(hits.points_km, axis=1)[:, None])
    off = np.abs(np.linalg.norm(hits.points_km / RADII_KM, axis=1) - surface)
    assert np.percentile(off, 95) < 1e-5
    assert off.max() < 1e-3  # a ray that grazes the limb
    assert (hits.normals * (rays[hits.rays] @ true.body_from_j2000.T)).sum(axis=1).max() < 0.1
    flat, exact = met(rays, solid_of(true, relief=Terrain(np.zeros((90, 180), np.float32)))), met(rays, solid_of(true))
    np.testing.assert_array_equal(flat.rays, exact.rays)
    np.testing.assert_allclose(flat.points_km, exact.points_km, atol=1e-6)


def test_arcs_of_a_terrain_s_limb_rise_and_fall_on_their_own() -> None:
    """The mean over an arc scatters as that of independent parts of 20 degrees does."""
    angle = np.radians(np.arange(0, 120, 0.5))
    arc = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
    turns = Rotation.random(60, random_state=np.random.RandomState(1)).as_matrix()
    terrains = [random_terrain(np.random.default_rng(seed), 0.01) for seed in range(3)]
    means = [terrain.height(arc @ turn.T).mean() for terrain in terrains for turn in turns]
    assert np.std(means) == pytest.approx(0.01 * np.sqrt(20 / 120), rel=0.25)


def test_bending_has_the_size_requested_and_moves_no_disk() -> None:
    shift = bending(np.random.default_rng(2), 0.3, (40.0, 50.0), 30.0)
    assert shift is not None
    r, t = 30 * np.sqrt(np.random.default_rng(3).uniform(size=5000)), np.linspace(0, 40 * np.pi, 5000)
    x, y = 40 + r * np.cos(t), 50 + r * np.sin(t)
    moved = np.stack(shift(x, y)) - np.stack([x, y])
    assert np.abs(moved.mean(axis=1)).max() < 0.03
    assert np.sqrt((moved**2).sum(axis=0).mean()) == pytest.approx(0.3, rel=0.1)


def test_noise_is_as_wide_at_the_pole_as_at_the_equator() -> None:
    noise = sphere_noise(np.random.default_rng(0), 10.0)
    along = [
        np.abs(np.diff(noise[row])).mean() * 2048 / 360 / np.sin(np.radians((row + 0.5) * 180 / 1024))
        for row in (100, 512)
    ]
    assert along[0] == pytest.approx(along[1], rel=0.5)


def test_detector_counts_photons_and_saturates() -> None:
    random = np.random.default_rng(0)
    light = np.ones((200, 200))
    light[:, :2] = 0
    raw = Detector(1000.0, 4000.0, 20.0, 2.0, 10.0, 0.0).expose(light, random)[:, 2:]
    assert raw.mean() == pytest.approx(1020, rel=1e-3)
    assert raw.var() == pytest.approx(1020 / 10 + 2**2 + 1 / 12, rel=0.05)
    full = Detector(9000.0, 4000.0).expose(light, random)
    assert (full[:, 2:] == 4000).all()
    wedge = np.ones((200, 200))
    wedge[:, :100] = 0.25
    bent = Detector(1000.0, 4000.0, gamma=0.6, relative=0.0).expose(wedge, random)
    assert (bent[:, :100].mean() - 20) / (bent[:, 100:].mean() - 20) == pytest.approx(0.25**0.6, rel=0.01)


@pytest.mark.parametrize("picture", ["as-is", "mirrored-x", "mirrored-y", "turned-90", "turned-180"])
def test_truth_is_where_the_picture_has_it(picture: str) -> None:
    """A full disk's centroid in the file, and a turned camera that sees the same point of the body there."""
    scene = Scene(
        "x", "x", 4, target="callisto", frame_px=160, radius_px=20.0, phase_deg=1.0, picture=picture, map_noise=0.0,
        centre=(0.3, 0.4), surface="none", given="none",
    )  # fmt: skip
    true = true_geometry(scene)
    picture_dn = expose(scene, light_of(scene, true)[0], true.place_px()).astype(float)
    disk = picture_dn > 0.3 * picture_dn.max()
    np.testing.assert_allclose(centroid(disk), seen_place_px(scene, true), atol=0.15)
    seen = seen_geometry(scene, true)
    assert np.linalg.det(seen.camera_from_j2000) == pytest.approx(1)
    if not picture.startswith("mirrored"):
        np.testing.assert_allclose(seen.place_px(), seen_place_px(scene, true), atol=1e-6)


@pytest.mark.parametrize("seed", range(5))
def test_metadata_are_wrong_by_what_was_planted(seed: int) -> None:
    scene = Scene("x", "x", seed, radius_px=60.0, sun_off_deg=30.0, focal_error=0.002)
    true, errors = true_geometry(scene), planted_errors(scene)
    predicted = predicted_geometry(scene, true, errors)
    assert np.degrees(np.arccos(cos_between(true.target_from_spacecraft_km, true.camera_from_j2000[2]))) < 1
    same_focal = replace(predicted, focal_px=true.focal_px)
    np.testing.assert_allclose(same_focal.place_px() - true.place_px(), errors["offset_px"], atol=1e-6)
    ratio = np.linalg.norm(predicted.target_from_spacecraft_km) / np.linalg.norm(true.target_from_spacecraft_km)
    assert ratio == pytest.approx(errors["range_factor"])
    assert cos_between(predicted.sun_from_target_km, true.sun_from_target_km) == pytest.approx(np.cos(np.radians(30)))
    turned = predicted.body_from_j2000 @ true.body_from_j2000.T
    angle = np.degrees(np.arccos((np.trace(turned) - 1) / 2))
    assert angle == pytest.approx(np.linalg.norm(errors["attitude_deg"]), rel=1e-6)
    assert predicted.focal_px == pytest.approx((1 + errors["focal_error"]) * true.focal_px)
    assert 0 < abs(errors["focal_error"] - 0.002) <= 5 * FOCAL_SIGMA
    to_spacecraft = -true.target_from_spacecraft_km
    assert cos_between(to_spacecraft, true.sun_from_target_km) == pytest.approx(np.cos(np.radians(scene.phase_deg)))


def cos_between(a: np.ndarray, b: np.ndarray) -> float:
    return float(a @ b / np.linalg.norm(a) / np.linalg.norm(b))


def test_another_body_of_a_scene_is_where_it_is_said() -> None:
    """Beside: its centre lies 2.5 radii away in the given direction; light there, none between."""
    other = Other("beside", 0.4, 2.5, 90.0)
    scene = Scene(
        "x", "x", 6, target="callisto", frame_px=160, radius_px=20.0, phase_deg=5.0, centre=(0.5, 0.3), others=(other,)
    )
    true = true_geometry(scene)
    light, _ = light_of(scene, true)
    x, y = np.round(true.place_px()).astype(int)
    assert light[y + 50, x] > 0.2 * light.max()
    assert light[y + 31, x] < 0.05 * light.max()
