"""Kernel sets without any mission kernel: plain SPICE in a second process says what the projection says."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import spiceypy
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from catalog.camera import Camera, find_camera
from catalog.errors import FailedError
from catalog.pose import Pose
from catalog.spice import kernel_pool
from catalog.target import Target, find_target
from tasks.kernels.exposure import Exposure, without_aberration
from tasks.kernels.names import camera_frame, camera_frame_id
from tasks.kernels.round_trip import round_trip, spice_planes
from tasks.kernels.windows import windows
from tasks.kernels.write import KernelSet, write_kernel_set

BAR_DEG = 1e-4
OWN_CAMERA = Camera(name="my-camera", size_px=(400, 300), centre_px=(201.0, 148.0), focal_length_px=2e4)
OWN_BODY = Target(name="pebble", naif_id=2000433, radii_km=(17.0, 6.5, 5.0))
AT_REST, MOVING = {}, {"spacecraft_velocity_km_s": (5.0, -12.0, -3.0), "target_velocity_km_s": (-8.0, 9.0, 4.0)}


def exposure(product: str, camera: Camera, target: Target, et: float, **velocities: tuple[float, ...]) -> Exposure:
    """The target a third of the frame high, off the centre, with some attitude and Sun."""
    range_km = 3 * target.radii_km[0] * 2 * camera.focal_length_px / camera.size_px[1]
    camera_from_j2000, body_from_j2000 = Rotation.from_rotvec([[0.3, 1.0, -2.0], [1.0, 0.2, 0.5]]).as_matrix()
    centre = camera.ray(np.add(camera.centre_px, (31.0, -20.0)))
    pose = Pose(et, camera_from_j2000, camera_from_j2000.T @ centre * range_km, (5e8, 4e8, -2e8), body_from_j2000)
    return Exposure(product, camera, target, pose.replaced(**velocities), 0.5, {"image_sha256": "0" * 64, "é": "ü"})


@pytest.fixture(scope="module")
def sets(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[KernelSet, list[Exposure]]]:
    """One set of moving exposures seconds apart, one of poses that know no velocities."""
    folder = tmp_path_factory.mktemp(
        "a folder whose long name needs more than one string in a kernel of eighty characters"
    )
    cassini, enceladus = find_camera("cassini-nac"), find_target("enceladus")
    made = {
        "moving": [exposure(f"m{i}", cassini, enceladus, 1e8 + dt, **MOVING) for i, dt in enumerate((0.0, 1.5, 600.0))],
        "resting": [exposure("r0", OWN_CAMERA, OWN_BODY, 2e8), exposure("r1", cassini, enceladus, 2e8 + 40)],
    }
    with kernel_pool([]) as loaded:
        return {name: (write_kernel_set(name, members, folder, loaded), members) for name, members in made.items()}


@pytest.mark.parametrize(("name", "corrections"), [("moving", "LT+S"), ("moving", "CN+S"), ("resting", "LT+S")])
def test_plain_spice_agrees_with_the_projection(sets, name, corrections):
    kernel_set, exposures = sets[name]
    found = round_trip(kernel_set, exposures, "alone", corrections=corrections)
    largest = max(max(by_plane.values()) for by_plane in found)
    print(f"{name}, {corrections}: plain SPICE differs by at most {largest:.1e} deg, the bar is {BAR_DEG}")
    assert len(found) == len(exposures)
    assert largest < BAR_DEG


def test_a_pose_without_velocities_or_mission_kernels_has_no_set_to_follow_them(sets):
    kernel_set, exposures = sets["resting"]
    assert set(kernel_set.meta_kernels) == {"alone"}
    assert {(n["product"], n["what"]) for n in kernel_set.left_out} >= {(e.product, "mission") for e in exposures}


def test_coverage_is_the_exposures_only(sets):
    kernel_set, exposures = sets["moving"]
    structure = -camera_frame_id(exposures[0].camera)
    with kernel_pool([kernel_set.files[".tsc"], kernel_set.files[".tf"]]):
        span = spiceypy.ckcov(str(kernel_set.files[".bc"]), structure, False, "INTERVAL", 0.0, "TDB")
        spans = np.array([spiceypy.wnfetd(span, i) for i in range(spiceypy.wncard(span))])
    expected = [[e.pose.et - e.exposure_s / 2, e.pose.et + e.exposure_s / 2] for e in exposures]
    assert spans == pytest.approx(np.array(expected), abs=2e-6)
    bodies = spiceypy.cell_int(10)
    spiceypy.pckfrm(str(kernel_set.files[".bpc"]), bodies)
    assert list(bodies) == [exposures[0].target.naif_id]


def test_every_file_says_where_it_comes_from(sets):
    kernel_set, exposures = sets["moving"]
    for suffix, path in kernel_set.files.items():
        if suffix in (".bc", ".bpc", "_alone.bsp"):
            handle = spiceypy.dafopr(str(path))
            _, lines, _ = spiceypy.dafec(handle, 500, 200)
            spiceypy.dafcls(handle)
            text = "\n".join(lines)
        else:
            text = path.read_text(encoding="ascii")
        assert "planetpose" in text
        if suffix not in (".tsc", ".tf", ".tpc"):
            assert all(e.product in text for e in exposures), suffix
            assert "0" * 64 in text, suffix
            assert "body_from_j2000" in text, suffix


def test_the_field_of_view_is_the_frame(sets):
    kernel_set, _ = sets["resting"]
    with kernel_pool([kernel_set.meta_kernels["alone"]]):
        shape, frame, boresight, _, corners = spiceypy.getfov(-camera_frame_id(OWN_CAMERA), 4)
        number = spiceypy.bodn2c(camera_frame(OWN_CAMERA))
    assert (shape, frame, number) == ("RECTANGLE", camera_frame(OWN_CAMERA), -camera_frame_id(OWN_CAMERA))
    assert boresight == pytest.approx([0, 0, 1])
    assert OWN_CAMERA.project(np.array(corners)) == pytest.approx(
        np.array([[0, 0], [400, 0], [400, 300], [0, 300]]) - 0.5, abs=1e-6
    )


def test_simultaneous_exposures_are_not_mixed(tmp_path: Path):
    twins = [exposure(p, find_camera("cassini-nac"), find_target("enceladus"), 1e8, **MOVING) for p in ("a", "b")]
    with kernel_pool([]) as loaded:
        kernel_set = write_kernel_set("twins", twins, tmp_path, loaded)
    assert {n["product"] for n in kernel_set.left_out if n["what"] in ("camera", "attitude", "spacecraft")} == {"b"}
    assert max(round_trip(kernel_set, twins[:1], "alone")[0].values()) < BAR_DEG


def test_what_spice_cannot_do_is_reported_in_its_words(sets):
    kernel_set, exposures = sets["resting"]
    requested = {**kernel_set.names_of(exposures[0]), "et": 0.0, "xy_px": [[1.0, 1.0]]}
    with pytest.raises(FailedError, match="SPICE"):
        spice_planes([kernel_set.meta_kernels["alone"]], [requested])


@given(st.lists(st.tuples(st.floats(-1e3, 1e3), st.floats(0.01, 50), st.floats(0.01, 50)), min_size=1, max_size=8))
def test_windows_never_overlap_and_keep_their_middle(spans):
    middles, before, after = zip(*spans, strict=True)
    found = windows(middles, before, after, [0.005] * len(spans))
    assert found[0] is not None
    kept = sorted((w, m) for w, m in zip(found, middles, strict=True) if w is not None)
    assert all(w[0] <= m - 0.0049 and m + 0.0049 <= w[1] for w, m in kept)
    assert all(a[0][1] <= b[0][0] + 1e-9 for a, b in pairwise(kept))


def test_no_gap_opens_between_windows_that_overlap():
    first, second = windows([0.0, 15.0], [2.0, 2.0], [10.0, 14.0], [0.01, 0.01])
    assert (first, second) == ((-2.0, 10.0), (13.0, 29.0))
    first, second = windows([0.0, 9.0], [2.0, 2.0], [10.0, 10.0], [0.01, 0.01])
    assert (first, second) == ((-2.0, 7.0), (7.0, 19.0))


@given(st.tuples(*[st.floats(-40, 40)] * 3))
def test_aberration_is_undone_as_spice_does_it(velocity):
    apparent = spiceypy.stelab([3e5, -4e5, 1e5], list(velocity))
    true = without_aberration(np.array(apparent), np.array(velocity))
    assert np.abs(true - [3e5, -4e5, 1e5]).max() < 1e-6
