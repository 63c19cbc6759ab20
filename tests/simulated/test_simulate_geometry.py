"""What Mitsuba renders lies where the analytic projection says: the limb, markings, every sub-pixel; and no mirror. The
closed form that stands for it where nothing is published agrees."""

from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from catalog.basemap import BaseMap, uniform_map
from catalog.camera import Camera
from catalog.pose import Pose
from catalog.target import Target
from lab.simulate.small_world import EUROPA, europa_map, scene_of, small_camera, true_pose
from tasks.project.curves import limb_points
from tasks.project.points import body_points, latitude_longitude, pixels_of_points, surface_points, visible
from tasks.simulate import Scene, SceneSettings
from tasks.simulate.mitsuba_geometry import REACH_PX, SQUARE_PX, render_positions, squares_along
from tasks.simulate.window import Window

BAR_PX = 0.01
OVERSAMPLE = 6
RANGES_KM = (2e5, 9e5, 4e6)
FRAME = Window(0, 0, 216, 208)
# A body whose three radii differ by tens of per cent, for what a nearly round one would hide.
LONG_BODY = Target(name="Long", naif_id=1, radii_km=(1700.0, 1300.0, 1150.0))
SPOT_LATITUDE_DEG, SPOT_SIGMA_DEG = 12.0, 2.5


def camera_for(range_km: float) -> Camera:
    """A disk of about 180 px at any range, off the optical axis."""
    return Camera(
        name="test", size_px=(216, 208), centre_px=(90.4, 117.9), focal_length_px=90 * range_km / EUROPA.mean_radius_km
    )


@cache
def rendered(range_km: float) -> tuple[Camera, Pose, NDArray[np.float32]]:
    camera = camera_for(range_km)
    pose = true_pose(camera, range_km=range_km)
    return camera, pose, render_positions(pose, camera, EUROPA, FRAME, OVERSAMPLE)


def sub_pixels(window: Window) -> NDArray[np.float64]:
    """Pixel coordinates (ny*s, nx*s, 2) of the sub-pixels' centres."""
    x, y = (
        (np.arange(size * OVERSAMPLE) + 0.5) / OVERSAMPLE - 0.5 + first
        for size, first in ((window.shape[1], window.x0), (window.shape[0], window.y0))
    )
    return np.stack(np.meshgrid(x, y), axis=-1)


def limb_biases(hit: NDArray[np.bool_], xy: NDArray[np.float64], limb_xy: NDArray[np.float64]) -> dict[str, float]:
    """Rendered minus analytic limb in px, outward, averaged over the rows (columns) that cross each of four sides."""
    biases = {}
    middle, reach = limb_xy.mean(axis=0), 0.7 * np.ptp(limb_xy, axis=0) / 2
    for axis, names in ((0, ("left", "right")), (1, ("top", "bottom"))):
        hits = hit if axis == 0 else hit.T
        along, lines = (xy[0, :, 0], xy[:, 0, 1]) if axis == 0 else (xy[:, 0, 1], xy[0, :, 0])
        near = np.abs(lines - middle[1 - axis]) < reach[1 - axis]
        first, last = hits[near].argmax(axis=1), hits.shape[1] - 1 - hits[near][:, ::-1].argmax(axis=1)
        half = 0.5 / OVERSAMPLE
        for name, outward, edge in zip(names, (-1, 1), (along[first] - half, along[last] + half), strict=True):
            side = limb_xy[outward * (limb_xy[:, axis] - middle[axis]) > 0]
            side = side[np.argsort(side[:, 1 - axis])]
            analytic = np.interp(lines[near], side[:, 1 - axis], side[:, axis])
            biases[name] = float(outward * (edge - analytic).mean())
    return biases


@pytest.mark.parametrize("range_km", RANGES_KM)
def test_the_rendered_limb_is_the_analytic_one(range_km: float) -> None:
    camera, pose, points = rendered(range_km)
    biases = limb_biases(points.any(axis=-1), sub_pixels(FRAME), limb_points(pose, camera, EUROPA, 20_000))
    print(f"limb at {range_km:.0e} km:", {side: round(bias, 4) for side, bias in biases.items()}, f"px, bar {BAR_PX}")
    assert max(abs(bias) for bias in biases.values()) < BAR_PX


def test_the_rendered_limb_of_a_long_body_is_the_analytic_one() -> None:
    camera = camera_for(9e5)
    pose = true_pose(camera, range_km=9e5)
    hit = render_positions(pose, camera, LONG_BODY, FRAME, OVERSAMPLE).any(axis=-1)
    biases = limb_biases(hit, sub_pixels(FRAME), limb_points(pose, camera, LONG_BODY, 20_000))
    print("limb of a long body:", {side: round(bias, 4) for side, bias in biases.items()}, "px")
    assert max(abs(bias) for bias in biases.values()) < BAR_PX


@pytest.mark.parametrize("range_km", RANGES_KM)
def test_every_rendered_sub_pixel_sees_the_surface_point_of_the_analytic_projection(range_km: float) -> None:
    camera, pose, points = rendered(range_km)
    xy = sub_pixels(FRAME)
    expected = body_points(pose, camera, EUROPA, xy)
    both = points.any(axis=-1) & np.isfinite(expected[..., 0])
    away_px = pixels_of_points(pose, camera, points[both] * EUROPA.mean_radius_km) - xy[both]
    bias = away_px.mean(axis=0)
    print(f"surface at {range_km:.0e} km: bias {bias.round(4)}, rms {np.sqrt((away_px**2).mean()):.4f} px")
    assert np.abs(bias).max() < BAR_PX
    assert np.sqrt((away_px**2).mean()) < BAR_PX


def test_latitude_and_longitude_are_not_mirrored() -> None:
    camera, pose, points = rendered(RANGES_KM[1])
    expected = body_points(pose, camera, EUROPA, sub_pixels(FRAME))
    slant = np.einsum("...i,...i->...", expected, pose.spacecraft_in_body_km) / pose.range_km
    inner = slant > 0.5 * EUROPA.mean_radius_km  # emission below about 60 deg
    found, true = latitude_longitude(points[inner]), latitude_longitude(expected[inner])
    turned = (found[1] - true[1] + 180) % 360 - 180
    assert np.abs(found[0] - true[0]).max() < 0.02
    assert np.abs(turned * np.cos(np.radians(true[0]))).max() < 0.02
    assert np.ptp(true[0]) > 60  # so wide a spread that no mirror image could agree


def spot_map(latitude_deg: float, longitude_deg: float) -> BaseMap:
    """A round bright spot on a grey body, on a quarter-degree grid."""
    lat, lon = np.meshgrid(np.arange(89.875, -90, -0.25), np.arange(0.125, 360, 0.25), indexing="ij")
    albedo = 1 + 4 * spot(surface_points(EUROPA, lat, lon), latitude_deg, longitude_deg)
    return BaseMap("spot", albedo.astype(np.float32), 0.0, "spot")


def spot(points_km: NDArray[np.float64], latitude_deg: float, longitude_deg: float) -> NDArray[np.float64]:
    """Gaussian of the angle from the spot's centre."""
    centre = surface_points(EUROPA, latitude_deg, longitude_deg)
    chord = points_km / np.linalg.norm(points_km, axis=-1, keepdims=True) - centre / np.linalg.norm(centre)
    return np.exp(-0.5 * (np.linalg.norm(chord, axis=-1) / np.radians(SPOT_SIGMA_DEG)) ** 2)


def expected_photocentre(pose: Pose, camera: Camera, longitude_deg: float) -> NDArray[np.float64]:
    """Centre (2,) of the spot's light under Lambert's law, by summing over the surface instead of the image."""
    lat, lon = np.meshgrid(np.arange(-2, 26, 0.2), longitude_deg + np.arange(-15, 15, 0.2), indexing="ij")
    points = surface_points(EUROPA, lat, lon)
    normal = points / np.square(EUROPA.radii_km)
    # A patch of surface between meridians and parallels has the area r^3 cos(lat) |n| / (n . p), n = p / radii^2 here.
    area = np.linalg.norm(points, axis=-1) ** 3 * np.cos(np.radians(lat)) * np.linalg.norm(normal, axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    sight = pose.spacecraft_in_body_km - points
    distance = np.linalg.norm(sight, axis=-1)
    mu = np.einsum("...i,...i->...", normal, sight) / distance
    mu0 = np.maximum(normal @ pose.sun_direction_in_body, 0)
    weight = spot(points, SPOT_LATITUDE_DEG, longitude_deg) * mu0 * mu * area / distance**2
    assert visible(pose, EUROPA, points)[weight > 1e-3 * weight.max()].all()
    return np.einsum("ij,ijk->k", weight, pixels_of_points(pose, camera, points)) / weight.sum()


@pytest.mark.parametrize("rays", ["closed-form", "mitsuba"])
@pytest.mark.parametrize("range_km", RANGES_KM)
def test_a_rendered_spot_of_the_map_is_where_the_analytic_projection_puts_it(range_km: float, rays: str) -> None:
    camera = camera_for(range_km)
    pose = true_pose(camera, range_km=range_km)
    _, here = latitude_longitude(pose.spacecraft_in_body_km)
    longitude_deg = float(here) + 25
    expected = expected_photocentre(pose, camera, longitude_deg)
    x0, y0 = np.rint(expected).astype(int) - 32
    window = Window(int(x0), int(y0), int(x0) + 65, int(y0) + 65)
    images = [
        scene_of(camera, "lambert", basemap=basemap, oversample=OVERSAMPLE, rays=rays).render(pose, window).image()
        for basemap in (spot_map(SPOT_LATITUDE_DEG, longitude_deg), uniform_map())
    ]
    light = (images[0] - images[1]).astype(np.float64)
    y, x = np.indices(light.shape)
    found = np.array([(light * axis).sum() / light.sum() for axis in (x, y)]) + np.array([x0, y0])
    bias = found - expected
    print(f"spot at {range_km:.0e} km: bias {bias.round(4)} px, bar {BAR_PX}")
    assert np.abs(bias).max() < BAR_PX


def lambert_by_mitsuba(pose: Pose, camera: Camera, target: Target, oversample: int) -> NDArray[np.float64]:
    """Light of a Lambert body under a distant Sun as Mitsuba itself computes it, its camera set up by look_at."""
    import mitsuba as mi

    mi.set_variant("scalar_rgb")
    transform = mi.ScalarTransform4f
    unit = target.mean_radius_km
    body_from_camera = pose.camera_from_body.T
    origin = pose.spacecraft_in_body_km / unit
    nx, ny = camera.size_px
    scene: Any = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "direct"},
            "sensor": {
                "type": "perspective",
                "fov_axis": "x",
                "fov": float(np.degrees(2 * np.arctan(nx / 2 / camera.focal_length_px))),
                "to_world": transform().look_at(
                    origin=origin.tolist(),
                    target=(origin + 100 * body_from_camera[:, 2]).tolist(),
                    up=(-body_from_camera[:, 1]).tolist(),
                ),
                "near_clip": 10.0,
                "far_clip": 1e5,
                "film": {
                    "type": "hdrfilm",
                    "width": nx * oversample,
                    "height": ny * oversample,
                    "rfilter": {"type": "box"},
                },
                "sampler": {"type": "stratified", "sample_count": 1, "jitter": False},
            },
            "sun": {"type": "directional", "direction": (-pose.sun_direction_in_body).tolist(), "irradiance": np.pi},
            "shape": {
                "type": "shapegroup",
                "sphere": {"type": "sphere", "bsdf": {"type": "diffuse", "reflectance": 1.0}},
            },
            "body": {
                "type": "instance",
                "shapes": {"type": "ref", "id": "shape"},
                "to_world": transform().scale([r / unit for r in target.radii_km]),
            },
        }
    )
    return np.asarray(mi.render(scene), np.float64)[..., 1]


def test_our_lambert_shading_is_mitsubas_own() -> None:
    size = (200, 200)
    camera = small_camera(150, size).model_copy(update={"centre_px": (99.5, 99.5)})
    pose = true_pose(camera, centre_px=(104.2, 91.7), phase_deg=60)
    scene = Scene(camera, LONG_BODY, uniform_map(), scene_of(camera, "lambert").settings)
    window = Window(0, 0, *size)
    ours = scene.shade(scene.surface(pose, window, 2), pose, window, 2)[0]
    theirs = lambert_by_mitsuba(pose, camera, LONG_BODY, 2)
    inside = (ours > 0) & (theirs > 0)
    assert inside.sum() > 0.98 * max((ours > 0).sum(), (theirs > 0).sum())
    difference = (ours - theirs)[inside]
    print(f"Lambert against Mitsuba's: rms {difference.std():.1e}, mean {difference.mean():.1e} of 1")
    assert np.abs(difference.mean()) < 1e-4
    assert difference.std() < 1e-3


LIMB_BAR_PX, BRIGHTNESS_BAR = 0.005, 1e-4


@pytest.mark.parametrize("target", [EUROPA, LONG_BODY], ids=["round", "long"])
@pytest.mark.parametrize(("range_km", "phase_deg"), [(2e5, 5.0), (9e5, 60.0), (4e6, 130.0)])
def test_the_closed_form_shows_what_mitsuba_shows(range_km: float, phase_deg: float, target: Target) -> None:
    """Mitsuba's single precision moves points by 0.005 px at the farthest range, and what a map shows there with them:
    shading alone is compared there."""
    camera = camera_for(range_km)
    pose = true_pose(camera, range_km=range_km, phase_deg=phase_deg)
    scenes = {
        rays: Scene(camera, target, europa_map(), SceneSettings(photometry="mixture", oversample=3, rays=rays))
        for rays in ("closed-form", "mitsuba-limb", "mitsuba")
    }
    hits = {rays: scene.surface(pose, FRAME, 3).hit for rays, scene in scenes.items()}
    seen = {rays: scene.render(pose, FRAME) for rays, scene in scenes.items()}
    inside = seen["mitsuba"].coverage > 0.9999
    edge_px = 2 * 9 * np.sqrt(np.pi * hits["mitsuba"].sum() / 9)  # sub-pixels of a rim one pixel wide
    for rays in ("closed-form", "mitsuba-limb"):
        limb_px = (hits[rays] ^ hits["mitsuba"]).sum() / edge_px
        ours, theirs = (
            np.concatenate([each.shading, each.bases[: 0 if range_km > 1e6 else 4]])
            for each in (seen[rays], seen["mitsuba"])
        )
        off = np.sqrt(np.mean((ours - theirs)[:, inside] ** 2, axis=1)) / theirs.max(axis=(1, 2))
        print(f"{rays} against Mitsuba: limb {limb_px:.5f} px, brightness rms {off.max():.1e}")
        assert limb_px < LIMB_BAR_PX
        assert off.max() < BRIGHTNESS_BAR


def test_a_target_behind_the_camera_is_not_seen() -> None:
    camera = camera_for(9e5)
    pose = true_pose(camera, range_km=9e5)
    behind = pose.replaced(target_from_spacecraft_km=-pose.target_from_spacecraft_km)
    assert not scene_of(camera).surface(behind, FRAME, 2).hit.any()


def test_the_squares_along_a_limb_hold_all_that_is_near_its_lit_part() -> None:
    ny, nx = 131, 157
    y, x = np.mgrid[:ny, :nx]
    distance = np.hypot(x - 60.3, y - 70.8) - 55
    lit = (distance < 0) & (x < 60)
    covered = np.zeros((ny, nx), np.int64)
    for square in squares_along(distance < 0, lit):
        covered[square.y0 : square.y1, square.x0 : square.x1] += 1
    assert covered.max() == 1
    assert (covered[(np.abs(distance) < REACH_PX - 1) & (x < 59)] == 1).all()
    assert covered[x > 60 + 3 * REACH_PX].max() == 0
    assert covered[np.abs(distance) > 1.5 * (REACH_PX + SQUARE_PX)].max() == 0
    assert squares_along(np.zeros((9, 9), bool), np.zeros((9, 9), bool)) == []
