"""The pose found in the image alone, on disks whose truth is known: another renderer's where no markings are needed."""

from dataclasses import replace

import numpy as np
import pytest
from foreign_disk import foreign_disk, lambert, lommel_seeliger

from catalog.basemap import BaseMap
from catalog.errors import RefusedError
from catalog.observation import Observation
from catalog.pose import Pose
from catalog.rotation import vector_deg_from_rotation
from lab.simulate.europa57 import paper_images
from lab.simulate.small_world import (
    EUROPA,
    europa_map,
    flagged,
    observation_of,
    observed,
    scene_of,
    small_camera,
    true_pose,
)
from tasks.initial_pose import ImagePose, ImagePoseSettings, find_pose
from tasks.initial_pose.find import unmapped
from tasks.initial_pose.outline import find_outline
from tasks.initial_pose.time_known import ByTime, sun_by_orbit
from tasks.simulate import Scene
from tasks.simulate.suns import axes_of

SETTINGS = ImagePoseSettings()
SIZE = (260, 230)


def disk(centre=(131.3, 112.8), radius=60.0, azimuth_deg=200.0, phase_deg=50.0, law=lambert, peak=200.0):  # type: ignore[no-untyped-def]
    """Brightness of a lit sphere in a frame of SIZE, the light `azimuth_deg` from +x towards +y."""
    azimuth, phase = np.radians([azimuth_deg, phase_deg])
    sun = (np.sin(phase) * np.cos(azimuth), np.sin(phase) * np.sin(azimuth), -np.cos(phase))
    bright = foreign_disk(SIZE, centre, radius, sun, 0.9, law)
    return 10 + peak * bright / bright.max()


def apart_deg(azimuth_deg: float, phase_deg: float, other_azimuth_deg: float, other_phase_deg: float) -> float:
    """Angle between two directions of light."""
    a, b = (
        np.array([np.sin(p) * np.cos(z), np.sin(p) * np.sin(z), np.cos(p)])
        for z, p in (np.radians([azimuth_deg, phase_deg]), np.radians([other_azimuth_deg, other_phase_deg]))
    )
    return float(np.degrees(np.arccos(np.clip(a @ b, -1, 1))))


@pytest.mark.parametrize("phase_deg", [5.0, 30.0, 60.0, 95.0, 130.0])
@pytest.mark.parametrize(
    ("centre", "radius", "azimuth_deg", "law"),
    [
        ((131.3, 112.8), 60.0, 200.0, lambert),
        ((80.2, 150.7), 25.0, 70.0, lommel_seeliger),
        ((140.6, 60.4), 90.0, 120.0, lommel_seeliger),
    ],
)
def test_centre_radius_and_light_are_found(phase_deg, centre, radius, azimuth_deg, law) -> None:  # type: ignore[no-untyped-def]
    """The last one leaves the frame at its upper edge."""
    outline = find_outline(observed(disk(centre, radius, azimuth_deg, phase_deg, law)), EUROPA, SETTINGS.limb).outline
    off = outline.limb.centre_px - np.array(centre)
    sigma = np.sqrt(np.diag(outline.limb.covariance))
    assert (np.abs(off) < np.minimum(4 * sigma[:2], 1.6)).all()
    assert abs(np.log(outline.limb.mean_px / radius)) < 4 * sigma[2] < 0.15
    assert apart_deg(outline.sun.azimuth_deg, outline.sun.phase_deg, azimuth_deg, phase_deg) < 8.0


@pytest.mark.parametrize("radius", [8.0, 11.0, 15.0, 19.0])
@pytest.mark.parametrize("phase_deg", [10.0, 60.0, 100.0, 125.0])
def test_small_disks_are_found_within_their_errors(radius, phase_deg) -> None:  # type: ignore[no-untyped-def]
    """Law and blur leave a tenth of such a radius open: no arc is too short for that."""
    centre = (96.4, 121.7)
    frame = observed(disk(centre, radius, 130.0, phase_deg, lommel_seeliger), 2.0)
    outline = find_outline(frame, EUROPA, SETTINGS.limb).outline
    off = outline.limb.centre_px - np.array(centre)
    sigma = np.sqrt(np.diag(outline.limb.covariance))
    assert np.abs(off).max() < 1.6
    assert abs(np.log(outline.limb.mean_px / radius)) < 4 * sigma[2] < 0.5
    assert outline.limb.arc_sigma < SETTINGS.limb.radius_sigma


def test_a_small_crescent_before_an_uneven_sky_is_found() -> None:
    """As Voyager's C1201656 shows Neptune: the sky beside it is brighter, above the darkest corner, than half of it."""
    centre, phase_deg = (190.4, 121.7), 124.0
    x, y = np.meshgrid(np.linspace(0, 1, SIZE[0]), np.linspace(0, 1, SIZE[1]))
    picture = disk(centre, 14.0, 130.0, phase_deg, lommel_seeliger, 30.0) + 60 * x**2 + 12 * x * y**2
    outline = find_outline(observed(picture, 0.8), EUROPA, SETTINGS.limb).outline
    assert np.abs(outline.limb.centre_px - np.array(centre)).max() < 1.6
    assert apart_deg(outline.sun.azimuth_deg, outline.sun.phase_deg, 130.0, phase_deg) < 8.0


@pytest.mark.parametrize("has_gap", [False, True])
def test_a_small_disk_is_not_lost_among_the_edges_of_a_frame(has_gap: bool) -> None:
    """Lines, as a vidicon's borders and marks: nearly all pairs of edges that are drawn are of them. A gap on the limb
    hides what it covers, not the limb beside it."""
    centre, size = (190.4, 121.7), 700
    picture = np.full((size, size), 10.0)
    picture[: SIZE[1], : SIZE[0]] = disk(centre, 14.0, 180.0, 110.0, lommel_seeliger)
    for start in (300, 490, 680):
        picture[start : start + 4, 20:620] = 100
    gap = np.zeros(picture.shape, bool)
    gap[119:124, 175:180] = has_gap
    outline = find_outline(flagged(observed(picture, 2.0), gap), EUROPA, SETTINGS.limb).outline
    assert np.abs(outline.limb.centre_px - np.array(centre)).max() < 2.0
    assert abs(np.log(outline.limb.mean_px / 14.0)) < 0.25


def noise_alone() -> Observation:
    return observed(np.full(SIZE[::-1], 20.0), 3.0)


def straight_edge() -> Observation:
    x, y = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
    return observed(10 + 150.0 / (1 + np.exp((x + 0.3 * y - 150) / 1.5)))


def surface_alone() -> Observation:
    """A rough surface that fills the frame: craters with a lit and a dark side."""
    rng = np.random.default_rng(3)
    x, y = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
    image = np.full(x.shape, 100.0)
    for _ in range(60):
        cx, cy, r = rng.uniform(0, SIZE[0]), rng.uniform(0, SIZE[1]), rng.uniform(4, 30)
        u, v = (x - cx) / r, (y - cy) / r
        image += np.where(u * u + v * v < 1, 45 * u, 0)
    return observed(image)


def stars() -> Observation:
    image, rng = np.full(SIZE[::-1], 10.0), np.random.default_rng(4)
    for _ in range(40):
        image[rng.integers(2, SIZE[1] - 2), rng.integers(2, SIZE[0] - 2)] += rng.uniform(50, 3000)
    return observed(image)


def tiny_disk() -> Observation:
    return observed(disk(radius=2.5, phase_deg=20.0))


def thin_crescent() -> Observation:
    return observed(disk(radius=7.0, phase_deg=165.0))


@pytest.mark.parametrize("frame", [tiny_disk, thin_crescent])
def test_a_refusal_names_the_disks_that_are_not_looked_for(frame) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(RefusedError, match=r"less than 8 px and crescents thinner than 3 px") as refusal:
        find_outline(frame(), EUROPA, SETTINGS.limb)
    assert refusal.value.code == "no-limb"


@pytest.mark.parametrize("frame", [noise_alone, straight_edge, surface_alone, stars])
def test_a_frame_without_a_whole_curve_of_limb_is_refused(frame) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(RefusedError) as refusal:
        find_outline(frame(), EUROPA, SETTINGS.limb)
    assert refusal.value.code in ("no-limb", "limb-too-short")
    assert "--pose FILE" in refusal.value.remedy


def test_a_short_arc_is_refused_as_what_it_is() -> None:
    with pytest.raises(RefusedError) as refusal:
        find_outline(observed(disk((-120.0, 110.0), 200.0, 0.0, 20.0)), EUROPA, SETTINGS.limb)
    assert refusal.value.code in ("no-limb", "limb-too-short")


@pytest.mark.parametrize(
    ("centre", "radius", "azimuth_deg", "law"),
    [
        ((-230.4, 110.2), 270.0, 0.0, lambert),
        ((-280.4, 110.2), 320.0, 30.0, lommel_seeliger),
        ((131.0, 420.6), 240.0, 240.0, lommel_seeliger),
        ((470.3, 330.8), 300.0, 215.0, lambert),
    ],
)
def test_a_short_arc_gives_the_centre_where_the_range_is_known(centre, radius, azimuth_deg, law) -> None:  # type: ignore[no-untyped-def]
    """Without its radius the same arc is refused. A radius that is none of the frame's finds nothing."""
    seen = observed(disk(centre, radius, azimuth_deg, 40.0, law))
    with pytest.raises(RefusedError):
        find_outline(seen, EUROPA, SETTINGS.limb)
    limb = find_outline(seen, EUROPA, SETTINGS.limb, radius).outline.limb
    off, sigma = limb.centre_px - np.array(centre), np.sqrt(np.diag(limb.covariance))
    print(f"{limb.arc_deg:.0f} deg: {off.round(2)} +- {sigma[:2].round(2)} px")
    assert (np.abs(off) < np.minimum(4 * sigma[:2], 6.0)).all()
    assert abs(np.log(limb.mean_px / radius)) < 0.01
    with pytest.raises(RefusedError):
        find_outline(seen, EUROPA, SETTINGS.limb, 0.3 * radius)


@pytest.mark.parametrize(("phase_deg", "azimuth_deg"), [(10.0, 0.0), (20.0, 20.0), (24.0, 340.0)])
def test_a_nearly_full_disk_is_found_whose_sunlit_limb_is_outside_the_frame(
    phase_deg: float, azimuth_deg: float
) -> None:
    """What is seen of its edge is the terminator, and the limb's error says so."""
    centre = np.array([SIZE[0] - 4.0, 113.0])
    limb = find_outline(
        observed(disk(centre, 80.0, azimuth_deg, phase_deg, lommel_seeliger)), EUROPA, SETTINGS.limb
    ).outline.limb
    sigma = np.sqrt(np.diag(limb.covariance))
    assert (np.abs(limb.centre_px - centre) < 3 * sigma[:2]).all()
    assert abs(limb.mean_px / 80.0 - 1) < 3 * sigma[2] < 0.4


@pytest.mark.parametrize("frame", [noise_alone, surface_alone, stars])
def test_a_frame_without_any_limb_is_not_refused_for_a_short_one(frame) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(RefusedError) as refusal:
        find_outline(frame(), EUROPA, SETTINGS.limb)
    assert refusal.value.code == "no-limb"


def spoilt(observation: Observation, how: str) -> Observation:
    """The image with trouble of a real camera's."""
    rng = np.random.default_rng(5)
    image = observation.image.copy()
    if how == "missing lines":
        lines = np.zeros(image.shape, bool)
        lines[[90, 91, 92, 120, 121, 150]] = True
        return flagged(observation, lines, 0.0)
    if how == "stars and hot pixels":
        y, x = rng.integers(0, image.shape[0], 120), rng.integers(0, image.shape[1], 120)
        image[y, x] += rng.uniform(100, 5000, 120).astype(np.float32)
    elif how == "noise":
        image += rng.normal(0, 15, image.shape).astype(np.float32)
        return Observation(image, np.full(image.shape, 15.0, np.float32), observation.quality)
    elif how == "saturated limb":
        image = np.minimum(image, 120)
    return replace(observation, image=image)


@pytest.mark.parametrize("how", ["missing lines", "stars and hot pixels", "noise", "saturated limb"])
def test_trouble_in_the_frame_moves_the_disk_little(how: str) -> None:
    limb = find_outline(spoilt(observed(disk()), how), EUROPA, SETTINGS.limb).outline.limb
    assert np.hypot(*(limb.centre_px - (131.3, 112.8))) < 1.5
    assert abs(limb.mean_px / 60.0 - 1) < 0.03


def test_a_second_disk_is_reported() -> None:
    image = disk((70.0, 110.0), 45.0) + disk((190.0, 120.0), 40.0) - 10
    camera = small_camera(size_px=SIZE)
    found = find_pose(observed(image), unmapped(scene_of(camera)), None, SETTINGS)
    assert {doubt.partition(":")[0] for doubt in found.doubts} == {
        "several-disks",
        "orientation-unknown",
        "time-unknown",
    }


def orientation_error_deg(found: ImagePose, truth: Pose) -> float:
    """Angle between the orientations found and true, in the camera's frame."""
    turn = found.pose.camera_from_body.T @ truth.camera_from_body
    return float(np.linalg.norm(vector_deg_from_rotation(turn)))


@pytest.mark.parametrize(("phase_deg", "azimuth_deg"), [(20.0, 200.0), (75.0, 40.0)])
def test_the_maps_markings_give_the_orientation(phase_deg: float, azimuth_deg: float) -> None:
    camera = small_camera()
    scene = scene_of(camera, "mixture")
    truth = true_pose(camera, phase_deg=phase_deg, sun_azimuth_deg=azimuth_deg)
    found = find_pose(observation_of(scene_of(camera, "lommel-seeliger"), truth), scene, None, SETTINGS)
    assert found.has_orientation
    assert orientation_error_deg(found, truth) < 2.0
    assert abs(found.pose.range_km / truth.range_km - 1) < 4 * found.range_sigma
    moved = camera.project(found.pose.target_in_camera_km) - camera.project(truth.target_in_camera_km)
    assert np.hypot(*moved) < 1.0
    suns = [axes_of(p) @ p.camera_from_j2000 @ p.sun_from_target_km for p in (found.pose, truth)]
    cosine = suns[0] @ suns[1] / np.linalg.norm(suns[0]) / np.linalg.norm(suns[1])
    assert np.degrees(np.arccos(cosine)) < 4 * found.sun_sigma_deg
    assert 0 < found.priors.sun_deg <= found.sun_sigma_deg
    assert [doubt.partition(":")[0] for doubt in found.doubts] == ["time-unknown"]


def other_markings() -> BaseMap:
    """Markings that are not Europa's."""
    rng = np.random.default_rng(6)
    import cv2

    noise = sum(cv2.GaussianBlur(rng.standard_normal((256, 512)), (0, 0), s) * s for s in (2, 5, 12))
    return BaseMap("other", (1 + 0.15 * noise / noise.std()).clip(0.1).astype(np.float32), 0.0, "other")


def test_markings_of_another_map_give_no_orientation_and_the_doubt_says_so() -> None:
    camera = small_camera()
    observation = observation_of(scene_of(camera, "lommel-seeliger"), true_pose(camera, phase_deg=40.0))
    found = find_pose(observation, scene_of(camera, "mixture", other_markings()), None, SETTINGS)
    assert not found.has_orientation
    assert (found.priors.attitude_deg or 0) > 60
    assert found.doubts[0].startswith("orientation-unknown: the base map's markings single out no orientation")


@pytest.mark.parametrize("factor", [1.005, 1.5])
def test_a_trajectorys_range_is_the_prior_where_the_limb_agrees(factor: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Known to kilometres; a range that the limb contradicts is another body's, or another time's."""
    camera = small_camera()
    scene, truth = unmapped(scene_of(camera, "mixture")), true_pose(camera, phase_deg=40.0)
    monkeypatch.setattr(
        "tasks.initial_pose.find.known_by_time", lambda *_: ByTime(range_km=factor * truth.range_km, source="spice")
    )
    found = find_pose(observation_of(scene_of(camera, "lommel-seeliger"), truth), scene, 0.0, SETTINGS)
    if factor < 1.1:
        assert found.pose.range_km == pytest.approx(factor * truth.range_km)
        assert (found.priors.range_km, found.priors.range_share) == (20.0, None)
    else:
        assert abs(found.pose.range_km / truth.range_km - 1) < 4 * found.range_sigma
        assert found.priors.range_km is None
        assert found.priors.range_share == pytest.approx(max(4 * found.range_sigma, 0.02))


def test_the_body_is_at_rest_in_j2000_where_its_rotation_is_known() -> None:
    """A time makes the camera's orientation one of the sky, whichever way the body is seen."""
    truth = paper_images()["LOR_0034732619"].pose
    camera = small_camera(size_px=SIZE)
    scene = Scene(camera, EUROPA, europa_map())
    found = find_pose(observed(disk()), unmapped(scene), truth.et, SETTINGS)
    assert EUROPA.rotation is not None
    model = EUROPA.rotation.body_from_j2000(truth.et - found.pose.range_km / 299792.458)
    assert np.abs(found.pose.body_from_j2000 - model).max() < 1e-5


def test_the_sun_of_a_time_is_where_the_published_poses_have_it() -> None:
    for image in list(paper_images().values())[::8]:
        sun, true = sun_by_orbit(EUROPA.naif_id, image.pose.et), image.pose.sun_from_target_km
        assert sun is not None
        cosine = sun @ true / np.linalg.norm(sun) / np.linalg.norm(true)
        assert np.degrees(np.arccos(np.clip(cosine, -1, 1))) < 0.1
    assert sun_by_orbit(999, 0.0) is None
