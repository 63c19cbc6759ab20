"""Several bodies: what hides and shadows what, against a ray caster that counts points of the Sun's disk."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from catalog.body import Ring
from catalog.camera import Camera
from catalog.errors import RefusedError
from catalog.placed_body import PlacedBody
from catalog.pose import Pose, read_pose_file, write_pose_file
from catalog.rotation import rotation_from_vector_deg
from catalog.target import Target, find_target
from lab.bodies.caster import Annulus, Globe, cast, covered_sun
from lab.honesty.solids import Solid
from tasks.bodies.placed import bodies_of, in_frame, may_shadow, relevant
from tasks.bodies.seen import has_company, seen_by_frame
from tasks.bodies.shadow import covered_by_body
from tasks.ingest.bodies import Candidates, bodies_of_image

CAMERA = Camera(name="several", size_px=(200, 160), centre_px=(99.5, 79.5), focal_length_px=60_000.0)
SUN_KM = np.array([6.0e8, -4.5e8, -1.0e8])
RANGE_KM = 2.0e6


def pose_with(*bodies: PlacedBody, target_radius: float = 1800.0, sun_km: np.ndarray = SUN_KM) -> tuple[Pose, Target]:
    """A target on the boresight, along +Z of J2000."""
    body = rotation_from_vector_deg([20.0, -40.0, 65.0])
    target = Target(name="alpha", naif_id=1, radii_km=(target_radius, 0.98 * target_radius, 0.95 * target_radius))
    return Pose(2e8, np.eye(3), np.array([0.0, 0.0, RANGE_KM]), sun_km, body, bodies=bodies), target


def placed(offset_km: tuple[float, ...], radii_km: tuple[float, ...], naif_id: int = 2, **other: Any) -> PlacedBody:
    """Another body at an offset from the target."""
    turn = rotation_from_vector_deg([-10.0, 5.0 * naif_id, 30.0])
    return PlacedBody(
        name=f"body {naif_id}",
        naif_id=naif_id,
        radii_km=radii_km,
        from_target_km=offset_km,
        sun_from_body_km=tuple(SUN_KM - np.array(offset_km)),
        body_from_j2000=turn,
        **other,
    )


def globes_of(pose: Pose, target: Target) -> list[Globe]:
    """The same for the ray caster."""
    return [
        Globe(
            body.naif_id,
            Solid(body.pose.target_from_spacecraft_km, np.array(body.target.radii_km), body.pose.body_from_j2000),
            tuple(Annulus(ring.inner_km, ring.outer_km, ring.optical_depth) for ring in body.target.rings),
        )
        for body in bodies_of(pose, target)
    ]


TOWARDS_SUN = SUN_KM / np.linalg.norm(SUN_KM)
BESIDE = np.cross(TOWARDS_SUN, [0.0, 0.0, 1.0])
RINGS = (Ring(name="a", inner_km=1950.0, outer_km=2600.0, optical_depth=0.7),)
ARRANGEMENTS: dict[str, tuple[PlacedBody, ...]] = {
    "in front": (placed((900.0, 700.0, -9e4), (1200.0, 1100.0, 1000.0)),),
    "behind": (placed((-1500.0, 700.0, 3e5), (1500.0, 1500.0, 1400.0)),),
    "shadow": (placed(tuple(3e5 * TOWARDS_SUN + 900 * BESIDE), (900.0, 850.0, 800.0)),),
    "small caster": (placed(tuple(9e5 * TOWARDS_SUN), (300.0, 250.0, 220.0)),),
    "oblate caster": (placed(tuple(6e5 * TOWARDS_SUN + 30000 * BESIDE), (31000.0, 31000.0, 27000.0)),),
    "two": (
        placed((2200.0, 300.0, -8e4), (1000.0, 900.0, 900.0)),
        placed(tuple(2e5 * TOWARDS_SUN - 300 * BESIDE), (500.0, 500.0, 480.0), 3),
    ),
    "ring in front": (placed((2200.0, 0.0, -6e4), (900.0, 900.0, 850.0), rings=RINGS),),
}


@pytest.mark.parametrize("name", ARRANGEMENTS)
def test_pixels_see_what_the_ray_caster_sees(name: str) -> None:
    pose, target = pose_with(*ARRANGEMENTS[name])
    seen = seen_by_frame(pose, CAMERA, target)
    rays = CAMERA.ray(np.stack(np.meshgrid(np.arange(200), np.arange(160)), axis=-1)).reshape(-1, 3)
    truth = cast(rays, globes_of(pose, target), pose.target_from_spacecraft_km + SUN_KM, sun_points=200)
    assert np.mean(seen.body_id.ravel() != truth.body_id) < 1e-4
    same = (seen.body_id.ravel() == truth.body_id) & (truth.body_id != 0)
    off = np.abs(seen.shadow.ravel()[same] - truth.shadow[same])
    assert np.mean(off > 0.02) < 1e-3  # 200 points of the Sun tell the fraction to 0.01 or so
    hidden = seen.occulted.ravel()
    assert hidden.any() == (name in ("in front", "two", "ring in front"))
    assert not (hidden & (truth.body_id == 1)).any()
    if "shadow" in name or "caster" in name:
        assert (truth.shadow[same] > 0).mean() > 0.01


@pytest.mark.parametrize("radii", [(900.0, 850.0, 800.0), (31000.0, 31000.0, 27000.0), (300.0, 250.0, 220.0)])
def test_penumbrae_are_right_to_half_a_per_cent(radii: tuple[float, ...]) -> None:
    body = placed(tuple(6e5 * TOWARDS_SUN + 0.97 * radii[0] * BESIDE), radii)
    pose, target = pose_with(body)
    receiver, caster = sorted(bodies_of(pose, target), key=lambda each: each.naif_id)
    rng = np.random.default_rng(4)
    points = rng.normal(size=(400, 3))
    points *= np.array(target.radii_km) / np.linalg.norm(points, axis=1)[:, None]
    globes = sorted(globes_of(pose, target), key=lambda each: each.naif_id)
    truth = covered_sun(points, globes[0], globes, pose.target_from_spacecraft_km + SUN_KM, 4000)
    assert ((truth > 0.05) & (truth < 0.95)).sum() > 20
    assert covered_by_body(points, receiver, caster) == pytest.approx(truth, abs=0.004)


def test_rings_take_light_before_the_body_and_from_it() -> None:
    pose, target = pose_with()
    ringed = target.model_copy(update={"rings": RINGS})
    assert not has_company(pose, CAMERA, target)
    assert has_company(pose, CAMERA, ringed)
    seen = seen_by_frame(pose, CAMERA, ringed)
    before = (seen.ring_depth > 0) & (seen.body_id == 1)
    assert before.any()
    assert (seen.shadow > 0).any()
    cosine = (pose.body_from_j2000 @ [0, 0, 1])[2]
    assert np.median(seen.ring_depth[before]) == pytest.approx(0.7 / abs(cosine), rel=1e-3)
    lit = seen.shadow[seen.shadow > 0]
    through = abs((pose.body_from_j2000 @ TOWARDS_SUN)[2])
    assert np.median(lit) == pytest.approx(1 - np.exp(-0.7 / through), rel=1e-2)


def test_only_what_may_be_seen_or_shadow_is_relevant() -> None:
    far = placed((5e6, 0.0, 0.0), (1000.0, 1000.0, 1000.0))
    beside = placed((4e3, 0.0, 0.0), (1000.0, 1000.0, 1000.0), 3)
    caster = placed(tuple(3e5 * TOWARDS_SUN), (900.0, 850.0, 800.0), 4)
    speck = placed(tuple(5e3 * BESIDE), (0.5, 0.5, 0.5), 5)
    pose, target = pose_with()
    assert [body.naif_id for body in relevant(pose, CAMERA, target, [far, beside, caster, speck])] == [3, 4]
    by_id = {body.naif_id: body for body in bodies_of(pose.replaced(bodies=(far, beside, caster)), target)}
    assert not in_frame(by_id[2], CAMERA)
    assert may_shadow(by_id[4], by_id[1])
    assert not may_shadow(by_id[1], by_id[4])
    assert not has_company(pose.replaced(bodies=(far,)), CAMERA, target)


def test_a_pose_file_keeps_its_bodies(tmp_path: Path) -> None:
    pose, _ = pose_with(
        placed((900.0, 700.0, -9e4), (1200.0, 1100.0, 1000.0), rings=RINGS, seen_from_km={1: (1, 2, 3)})
    )
    write_pose_file(pose, tmp_path / "pose.json")
    again = read_pose_file(tmp_path / "pose.json").completed()
    assert again.bodies == pose.bodies
    assert Pose.from_dict(pose.to_dict()).to_dict() == pose.to_dict()
    assert "bodies" not in pose.replaced(bodies=()).to_dict()


def test_short_entries_are_made_whole_from_the_catalog() -> None:
    pose, _ = pose_with()
    io = find_target("io")
    (jupiter,) = bodies_of_image(
        pose, CAMERA, io, ({"name": "Jupiter", "from_spacecraft_km": [1e5, 0, 2.2e6]},), Candidates()
    )
    assert jupiter.naif_id == 599
    assert jupiter.radii_km == find_target("jupiter").radii_km
    assert jupiter.from_target_km == pytest.approx((1e5, 0, 2e5))
    assert jupiter.sun_from_body_km == pytest.approx(SUN_KM - [1e5, 0, 2e5])


@pytest.mark.parametrize(
    ("entry", "fault"),
    [
        ({"name": "rock", "from_target_km": [1, 2, 3]}, "naif_id"),
        ({"name": "europa"}, "needs from_target_km or from_spacecraft_km"),
        ({"name": "europa", "from_target_km": [1, 2, 3], "from_spacecraft_km": [1, 2, 3]}, "one of them"),
        ({"name": "europa", "from_target_km": [1, 2]}, "three numbers"),
        ({"name": "europa", "from_target_km": ["a", 2, 3]}, "three numbers"),
        ({"name": "europa", "from_target_km": [1, 2, 3], "radius": 5}, "radius"),
        ({"name": "europa", "from_target_km": [1, 2, 3], "body_from_j2000": [[1, 0], [0, 1]]}, "3x3"),
        ({"name": "io", "from_target_km": [1, 2, 3]}, "the target io itself"),
    ],
)
def test_bad_entries_are_named(entry: dict[str, Any], fault: str, tmp_path: Path) -> None:
    pose, _ = pose_with()
    with pytest.raises(RefusedError, match=fault) as refused:
        bodies_of_image(pose, CAMERA, find_target("io"), (entry,), Candidates(), tmp_path / "my.json")
    assert "my.json" in refused.value.fault


def test_bodies_that_nothing_places_are_refused() -> None:
    pose, target = pose_with()
    with pytest.raises(RefusedError, match=r"no loaded kernel places europa.*--kernels"):
        bodies_of_image(pose, CAMERA, target, (), Candidates((find_target("europa"),), named=True))


def test_positions_move_with_the_target() -> None:
    body = placed((900.0, 700.0, -9e4), (1200.0, 1100.0, 1000.0))
    pose, target = pose_with(body)
    turned = replace(pose, camera_from_j2000=rotation_from_vector_deg([0.01, 0.02, 0]) @ pose.camera_from_j2000)
    before, after = (
        [CAMERA.project(each.pose.target_in_camera_km) for each in bodies_of(p, target)] for p in (pose, turned)
    )
    assert np.ptp([a - b for a, b in zip(after, before, strict=True)], axis=0) == pytest.approx([0, 0], abs=0.01)
