"""Several bodies against SPICE: SINCPT on every body, ILUMIN, shadow rays by SURFPT, limbs by EDLIMB."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import spiceypy

from catalog.camera import Camera, find_camera
from catalog.errors import RefusedError
from catalog.pose import Pose
from catalog.rotation import nearest_rotation
from catalog.spice import kernel_pool
from catalog.spice_pose import pose_parts_from_loaded
from catalog.target import Target, find_target
from tasks.bodies.placed import SUN_RADIUS_KM, bodies_of
from tasks.bodies.seen import has_company, seen_by_frame
from tasks.ingest.bodies import bodies_of_image, candidates_for

# Voyager 1 on its way to Jupiter: what the kernels say of the moons then.
SCENES = {
    "io before jupiter": ("1979-03-03T00:20:00", "io"),
    "io beside jupiter's limb": ("1979-03-01T04:20:00", "io"),
    "io's shadow on jupiter": ("1979-03-03T02:00:00", "jupiter"),
    "ganymede's shadow on jupiter": ("1979-03-01T18:00:00", "jupiter"),
}
NAMES = {599: "IAU_JUPITER", 501: "IAU_IO", 502: "IAU_EUROPA", 503: "IAU_GANYMEDE", 504: "IAU_CALLISTO"}


@pytest.fixture(scope="module")
def kernels(data_folder: Path) -> Iterator[Path]:
    with kernel_pool([data_folder / "kernels"]):
        yield data_folder / "kernels"


def looking_at(utc: str, name: str, kernels: Path, bodies: tuple[str, ...] = ()) -> tuple[Pose, Camera, Target]:
    """A pose of Voyager 1's narrow-angle camera that looks at a body, its bodies by kernels."""
    camera, target = find_camera("voyager1-nac"), find_target(name)
    with kernel_pool([kernels]) as loaded:
        parts = pose_parts_from_loaded(camera, target, spiceypy.str2et(utc), loaded).parts
        ahead = parts.target_from_spacecraft_km / np.linalg.norm(parts.target_from_spacecraft_km)
        right = np.cross([0.0, 0.0, -1.0], ahead)
        right /= np.linalg.norm(right)
        rotation = nearest_rotation(np.stack([right, np.cross(ahead, right), ahead]))
        pose = Pose(
            parts.et,
            rotation,
            parts.target_from_spacecraft_km,
            parts.sun_from_target_km,
            parts.body_from_j2000,
            parts.spacecraft_velocity_km_s,
            parts.target_velocity_km_s,
        )
        found = bodies_of_image(pose, camera, target, (), candidates_for(bodies, target, [kernels]))
    return pose.replaced(bodies=found), camera, target


def by_spice(pose: Pose, camera: Camera, xy: np.ndarray, ids: list[int]) -> tuple[int, np.ndarray]:
    """Body id and (latitude, longitude, incidence, emission, phase, range) of a pixel, by SINCPT and ILUMIN."""
    ray = camera.ray(xy) @ pose.camera_from_j2000
    nearest, seen, values = np.inf, 0, np.full(6, np.nan)
    for naif_id in ids:
        try:
            point, _, towards = spiceypy.sincpt(
                "ELLIPSOID", str(naif_id), pose.et, NAMES[naif_id], "LT+S", "-31", "J2000", ray
            )
        except spiceypy.NotFoundError:
            continue
        distance = float(np.linalg.norm(towards))
        if distance < nearest:
            nearest, seen = distance, naif_id
            _, _, phase, incidence, emission = spiceypy.ilumin(
                "ELLIPSOID", str(naif_id), pose.et, NAMES[naif_id], "LT+S", "-31", point
            )
            _, longitude, latitude = spiceypy.reclat(point)
            angles = np.degrees([latitude, longitude % (2 * np.pi), incidence, emission, phase])
            values = np.array([*angles, distance])
    return seen, values


def covered_by_spice(pose: Pose, receiver: int, point: np.ndarray, casters: list[int], count: int = 200) -> float:
    """Fraction of the Sun's disk that casters cover at a body-fixed point, by rays of SURFPT to points of the disk."""
    light_time = spiceypy.spkpos(str(receiver), pose.et, "J2000", "LT+S", "-31")[1]
    when = pose.et - light_time
    fixed = spiceypy.pxform(NAMES[receiver], "J2000", when)
    place = fixed @ point
    sun = spiceypy.spkpos("10", when, "J2000", "LT+S", str(receiver))[0] - place
    axis = sun / np.linalg.norm(sun)
    side = np.cross(axis, [0.0, 0.0, 1.0])
    side /= np.linalg.norm(side)
    k = np.arange(count) + 0.5
    radius, angle = SUN_RADIUS_KM * np.sqrt(k / count), np.pi * (1 + 5**0.5) * k
    disk = radius[:, None] * (np.cos(angle)[:, None] * side + np.sin(angle)[:, None] * np.cross(axis, side))
    blocked = np.zeros(count, bool)
    for caster in casters:
        if caster == receiver:
            continue
        away, back = spiceypy.spkpos(str(caster), when, "J2000", "LT+S", str(receiver))
        turn = spiceypy.pxform("J2000", NAMES[caster], when - back)
        start = turn @ (place - away)
        radii = spiceypy.bodvcd(caster, "RADII", 3)[1]
        for number, to in enumerate(sun + disk):
            try:
                spiceypy.surfpt(start, turn @ to, *radii)
                blocked[number] = True
            except spiceypy.NotFoundError:
                continue
    return float(blocked.mean())


@pytest.mark.parametrize("name", SCENES)
def test_pixels_see_what_spice_sees(name: str, kernels: Path) -> None:
    pose, camera, target = looking_at(*SCENES[name], kernels)
    assert has_company(pose, camera, target)
    seen = seen_by_frame(pose, camera, target)
    ids = [body.naif_id for body in bodies_of(pose, target)]
    assert {599, target.naif_id} <= set(ids)
    assert len(ids) > 1
    rng = np.random.default_rng(3)
    pixels = rng.integers(0, camera.size_px, (150, 2))
    edges = np.argwhere(np.diff(seen.body_id, axis=1) != 0)[:, ::-1]
    pixels = np.vstack([pixels, edges[rng.integers(0, len(edges), 50)]]) if len(edges) else pixels
    wrong = 0
    for x, y in pixels:
        body_id, values = by_spice(pose, camera, np.array([x, y], float), ids)
        if seen.body_id[y, x] != body_id:
            wrong += 1
            continue
        if not body_id or values[3] > 85:
            continue
        mine = [seen.planes[key][y, x] for key in ("latitude", "longitude", "incidence", "emission", "phase")]
        off = np.abs(np.array(mine) - values[:5])
        off[1] = min(off[1], 360 - off[1]) * np.cos(np.radians(values[0]))
        assert off.max() < 0.004  # ILUMIN's Sun on Jupiter, see `project_planes`
        assert seen.planes["range_km"][y, x] == pytest.approx(values[5], rel=1e-6)
    assert wrong <= 1  # SINCPT's LT+S is one iteration of light time: the limb of Jupiter by 0.02 px


@pytest.mark.parametrize("name", ["io's shadow on jupiter", "ganymede's shadow on jupiter"])
def test_shadows_are_where_rays_to_the_sun_are_blocked(name: str, kernels: Path) -> None:
    pose, camera, target = looking_at(*SCENES[name], kernels)
    pose, camera = with_shadow_in_frame(pose, camera, target)
    seen = seen_by_frame(pose, camera, target)
    partly = np.argwhere((seen.shadow > 0) & (seen.shadow < 1) & (seen.body_id == 599))
    umbra = np.argwhere((seen.shadow == 1) & (seen.body_id == 599))
    assert len(umbra) > 30
    assert len(partly) > 10
    rng = np.random.default_rng(1)
    clear = np.argwhere((seen.shadow == 0) & (seen.body_id == 599))
    casters = [body.naif_id for body in bodies_of(pose, target)]
    for places, allowed in ((partly, 0.02), (umbra, 0.0), (clear, 0.0)):
        for y, x in places[rng.integers(0, len(places), 15)]:
            point = np.array([seen.planes[key][y, x] for key in ("x_km", "y_km", "z_km")])
            # the point lies where the body was when its own light left: 0.2 s after the centre's
            assert seen.shadow[y, x] == pytest.approx(covered_by_spice(pose, 599, point, casters), abs=allowed + 1e-9)


def with_shadow_in_frame(pose: Pose, camera: Camera, target: Target) -> tuple[Pose, Camera]:
    """A camera of a quarter of the focal length, which has all of Jupiter in its frame."""
    return pose, camera.model_copy(update={"focal_length_px": camera.focal_length_px / 4})


def test_limbs_of_other_bodies_are_those_of_edlimb(kernels: Path) -> None:
    from tasks.project.curves import limb

    pose, camera, target = looking_at(*SCENES["io before jupiter"], kernels)
    still = pose.replaced(spacecraft_velocity_km_s=None, target_velocity_km_s=None)
    jupiter = next(body for body in bodies_of(still, target) if body.naif_id == 599)
    ellipse = spiceypy.edlimb(*jupiter.target.radii_km, jupiter.pose.spacecraft_in_body_km)
    points = limb(jupiter.pose, camera, jupiter.target, 200).points_km - ellipse.center
    across = np.stack([points @ axis / (axis @ axis) for axis in (ellipse.semi_major, ellipse.semi_minor)])
    assert np.allclose(np.hypot(*across), 1, atol=1e-9)


def test_named_bodies_alone_are_placed(kernels: Path) -> None:
    pose, _, _ = looking_at(*SCENES["io before jupiter"], kernels, ("europa",))
    assert [body.name for body in pose.bodies] == ["europa"]
    assert looking_at(*SCENES["io before jupiter"], kernels, ("none",))[0].bodies == ()
    with pytest.raises(RefusedError, match="no loaded kernel places titan"):
        looking_at(*SCENES["io before jupiter"], kernels, ("titan",))
