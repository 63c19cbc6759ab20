"""What other bodies take from the image, and their own places."""

import numpy as np
import pytest

from catalog.basemap import uniform_map
from catalog.camera import Camera
from catalog.observation import Observation, Quality
from catalog.placed_body import PlacedBody
from catalog.pose import Pose
from catalog.target import Target, find_target
from lab.bodies.picture import picture_of
from lab.bodies.scenes import FRAME_PX, scene_of
from tasks.bodies.masks import alone, grown, without_target
from tasks.bodies.placed import bodies_of
from tasks.ingest.bodies import Candidates, bodies_of_image
from tasks.separations.measure import as_target_of, measured_bodies, separations
from tasks.simulate import Scene, SceneSettings
from tasks.simulate.others import OtherBodiesSettings

CAMERA = Camera(name="masks", size_px=(200, 160), centre_px=(99.5, 79.5), focal_length_px=60_000.0, psf_sigma_px=1.0)
TARGET = Target(name="alpha", naif_id=1, radii_km=(900.0, 900.0, 900.0))  # 27 px at 2e6 km
SUN_KM = (4e8, 1e8, -6e8)


def pose_with(*bodies: PlacedBody) -> Pose:
    return Pose(2e8, np.eye(3), np.array([0, 0, 2e6]), np.array(SUN_KM), np.eye(3), bodies=bodies)


def placed(x_km: float, z_km: float, radius_km: float, naif_id: int = 2, sigma_km: float = 0.0) -> PlacedBody:
    return PlacedBody(
        name=f"body {naif_id}", naif_id=naif_id, radii_km=(radius_km,) * 3, from_target_km=(x_km, 1.0, z_km),
        sun_from_body_km=SUN_KM, sigma_km=sigma_km,
    )  # fmt: skip


def observation() -> Observation:
    return Observation(
        np.ones((160, 200), np.float32), np.ones((160, 200), np.float32), np.zeros((160, 200), np.uint16)
    )


def test_a_frame_of_one_body_is_left_as_it_is() -> None:
    scene, given = Scene(CAMERA, TARGET, uniform_map(), SceneSettings()), observation()
    assert alone(given, pose_with(), scene) is given
    assert alone(given, pose_with(placed(9e5, 0.0, 900.0)), scene) is given  # far outside the frame


@pytest.mark.parametrize("sigma_km", [0.0, 30.0])
def test_a_body_in_front_is_masked_with_its_margin(sigma_km: float) -> None:
    body = placed(1000.0, -1e5, 500.0, sigma_km=sigma_km)
    mask = without_target(pose_with(body), CAMERA, TARGET, 1.0)
    px_per_km = 60_000 / 1.9e6
    rows, columns = np.indices(mask.shape)
    away = np.hypot(columns - 99.5 - 1000 * px_per_km, rows - 79.5) / px_per_km - 500
    margin_km = (4.0 + 1.0) / px_per_km + 3 * sigma_km
    assert mask[away < margin_km - 1 / px_per_km].all()
    assert not mask[away > margin_km + 2 / px_per_km].any()


def test_light_behind_the_limb_stays_and_what_lies_beside_goes() -> None:
    straddling = without_target(pose_with(placed(5000.0, 3e5, 5200.0)), CAMERA, TARGET, 1.0)
    assert not straddling[79, 99 + 30]  # 3 px beyond the target's limb, before the other body
    assert straddling[79, 99 + 70]
    assert without_target(pose_with(placed(5000.0, 3e5, 5200.0)), CAMERA, TARGET, 1.0, keep_behind=False)[79, 99 + 30]
    beside = without_target(pose_with(placed(8000.0, 3e5, 6700.0)), CAMERA, TARGET, 1.0)
    assert not beside[79, 99 + 26]
    assert beside[79, 99 + 70]
    transit = without_target(pose_with(placed(0.0, 3e5, 50_000.0)), CAMERA, TARGET, 1.0)
    assert not transit.any()


def test_shadows_on_the_target_are_masked_and_move_with_it() -> None:
    towards = np.array(SUN_KM) / np.linalg.norm(SUN_KM)
    caster = PlacedBody(
        name="caster", naif_id=3, radii_km=(300.0,) * 3, from_target_km=tuple(1e5 * towards), sun_from_body_km=SUN_KM,
        sigma_km=0.0,
    )  # fmt: skip
    masks = []
    for shift_px in (0.0, 10.0):
        turn = np.array([[1, 0, shift_px / 6e4], [0, 1, 0], [-shift_px / 6e4, 0, 1]])
        u, _, vt = np.linalg.svd(turn)
        masks.append(without_target(pose_with(caster).replaced(camera_from_j2000=u @ vt), CAMERA, TARGET, 1.0))
    assert 100 < masks[0].sum() < 3000
    assert np.mean(np.roll(masks[0], 10, axis=1) != masks[1]) < 2e-3


def test_masks_grow_and_shrink() -> None:
    square = np.zeros((40, 40), bool)
    square[10:30, 10:30] = True
    assert grown(square, 3).sum() > square.sum() > grown(square, -3).sum() == 14 * 14
    assert grown(square, 0) is square


def test_other_bodies_are_measured_and_separations_stated() -> None:
    scene = scene_of("half-hidden", 1)
    picture, middle = picture_of(scene).astype(np.float32), (FRAME_PX - 1) / 2
    camera = Camera(
        name="x", size_px=(FRAME_PX, FRAME_PX), centre_px=(middle, middle), focal_length_px=scene.lens.focal_px,
        psf_sigma_px=scene.lens.psf_px,
    )  # fmt: skip
    target = find_target(scene.target)
    pose = Pose(2e8, scene.camera_from_j2000, scene.target_km, scene.sun_km, scene.body_from_j2000)
    pose = pose.replaced(bodies=bodies_of_image(pose, camera, target, tuple(scene.pose()["bodies"]), Candidates()))
    saturated = np.where(picture >= scene.lens.full_dn, np.uint16(Quality.SATURATED), np.uint16(0)).astype(np.uint16)
    given = Observation(picture, np.full(picture.shape, 2.0, np.float32), saturated)
    (found,) = measured_bodies(given, pose, Scene(camera, target, uniform_map(), SceneSettings()))
    sight = scene.camera_from_j2000 @ (scene.target_km + scene.others[0].from_target_km)
    true = sight[:2] / sight[2] * scene.lens.focal_px + middle
    assert found.by == "disk"
    assert np.hypot(*(np.array(found.measured_px) - true)) < 0.05
    assert max(found.sigma_px or ()) < 0.05
    correction = {"centre_px": scene.centre_px.tolist(), "uncertainty": {"centre_px": [0.01, 0.01]}}
    (stated,) = separations((found,), correction, camera, pose.range_km)
    expected = np.degrees(np.arccos(np.clip(_cosine(scene.target_km, scene.others[0].from_target_km), -1, 1))) * 3600
    scale = np.degrees(1 / scene.lens.focal_px) * 3600
    assert stated["separation"]["arcsec"] == pytest.approx(expected, abs=0.05 * scale)
    assert 0 < stated["separation"]["sigma_arcsec"] < 0.06 * scale
    own = as_target_of(pose, target, next(body for body in bodies_of(pose, target) if body.place))
    assert own.target_from_spacecraft_km + own.bodies[0].offset_km == pytest.approx(pose.target_from_spacecraft_km)


def _cosine(target_km: np.ndarray, offset_km: np.ndarray) -> float:
    other = target_km + offset_km
    return float(target_km @ other / np.linalg.norm(target_km) / np.linalg.norm(other))


def test_margins_are_the_settings_of_the_profile() -> None:
    body = placed(500.0, -1e5, 500.0)
    usual = without_target(pose_with(body), CAMERA, TARGET, 1.0)
    tight = OtherBodiesSettings(blur_sigmas=0, pixel_px=0, place_sigmas=0)
    least = without_target(pose_with(body), CAMERA, TARGET, 1.0, settings=tight)
    assert 0 < least.sum() < usual.sum()
    assert (usual | ~least).all()
    wide = OtherBodiesSettings(blur_sigmas=12)
    assert without_target(pose_with(body), CAMERA, TARGET, 1.0, settings=wide).sum() > usual.sum()
