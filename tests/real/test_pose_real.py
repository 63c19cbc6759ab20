"""Initial poses of real images against independent figures."""

import json
from pathlib import Path

import numpy as np
import pytest

from catalog.camera import find_camera
from catalog.errors import RefusedError
from catalog.readers import read_frame
from catalog.rotation import nearest_rotation
from catalog.spice import kernel_pool
from catalog.target import find_target
from tasks.ingest.pose import InitialPose, initial_pose

pytestmark = pytest.mark.real

C_MATRIX_OF_F1636832_B1950 = [
    [0.595661, 0.568173, 0.567773],
    [0.174710, 0.598289, -0.782002],
    [-0.784005, 0.565004, 0.257112],
]


def _sub_point_west(direction_in_body: np.ndarray) -> tuple[float, float]:
    """Planetocentric latitude and *west* longitude, degrees."""
    x, y, z = direction_in_body / np.linalg.norm(direction_in_body)
    return float(np.degrees(np.arcsin(z))), float(-np.degrees(np.arctan2(y, x)) % 360)


@pytest.fixture
def voyager_pose(data_folder: Path, tmp_path: Path) -> InitialPose:
    """f1636832: the archived C-matrix by pose file, positions from the kernels."""
    import spiceypy

    with kernel_pool([]):
        b1950_from_j2000 = spiceypy.pxform("J2000", "B1950", 0.0)
    camera_from_j2000 = nearest_rotation(nearest_rotation(C_MATRIX_OF_F1636832_B1950) @ b1950_from_j2000)
    pose_file = tmp_path / "f1636832.json"
    pose_file.write_text(json.dumps({"camera_from_j2000": camera_from_j2000.tolist()}))
    frame = read_frame(data_folder / "images" / "voyager" / "f1636832.raw", target="io")
    kernels = [data_folder / "kernels"]
    return initial_pose(frame, find_camera("voyager1-nac"), find_target("io"), kernels, pose_file)


def test_voyager_c_matrix_from_a_pose_file_is_completed_by_spice(voyager_pose: InitialPose) -> None:
    """JPL's log of this frame used another ephemeris and rotation of Io: its longitudes are 1.40 deg larger."""
    pose = voyager_pose.pose
    spacecraft = _sub_point_west(pose.spacecraft_in_body_km)
    sun = _sub_point_west(pose.sun_direction_in_body)
    x, y = find_camera("voyager1-nac").project(pose.target_in_camera_km)
    print(f"range {pose.range_km:.1f} km (JPL 806029.9)")
    print(f"sub-spacecraft {spacecraft[0]:.4f} N {spacecraft[1]:.3f} W (JPL -0.0324, 156.474)")
    print(f"sub-solar {sun[0]:.3f} N {sun[1]:.3f} W (JPL 0.541, 171.276)")
    print(f"predicted centre line {y + 1:.2f} sample {x + 1:.2f} (JPL 484.06, 569.94)")
    assert voyager_pose.source == "file"
    assert {voyager_pose.sources[key] for key in ("target_from_spacecraft_km", "body_from_j2000")} == {"spice"}
    assert pose.range_km == pytest.approx(806029.9, abs=40)
    assert sun[1] - spacecraft[1] == pytest.approx(171.276 - 156.474, abs=0.005)
    assert spacecraft[0] == pytest.approx(-0.0324, abs=0.06)
    assert sun[0] == pytest.approx(0.541, abs=0.06)
    assert np.hypot(x + 1 - 569.94, y + 1 - 484.06) < 10  # 8.3 px are 53 km at this range


def test_the_kernels_in_use_are_recorded_with_their_hashes(voyager_pose: InitialPose) -> None:
    names = {kernel["name"] for kernel in voyager_pose.kernels}
    assert {"naif0012.tls", "pck00010.tpc", "vgr1_jup230.bsp", "galsat_vg1.bsp"} <= names
    assert all(len(kernel["sha256"]) == 64 for kernel in voyager_pose.kernels)
    assert any("VG1_SCAN_PLATFORM" in text for text in voyager_pose.missing)


def test_galileo_label_gives_the_whole_pose_and_its_range_agrees_with_spice(data_folder: Path) -> None:
    frame = read_frame(data_folder / "images" / "galileo" / "C0552809300R.IMG")
    camera = find_camera("galileo-ssi")
    found = initial_pose(frame, camera, find_target("europa"), [data_folder / "kernels"])
    ranges = found.evidence["range_km"]
    print(f"range: label {ranges['label']:.0f} km, SPICE {ranges['spice']:.0f} km, source {found.source}")
    assert found.source == "label"
    assert found.sources["target_from_spacecraft_km"] == "label"
    assert ranges["spice"] == pytest.approx(ranges["label"], abs=30)
    np.testing.assert_allclose(camera.project(found.pose.target_in_camera_km), [212.914 - 1, 111.785 - 1], atol=1e-6)
    assert found.pose.phase_deg == pytest.approx(63.7, abs=0.1)


def test_galileo_label_directions_agree_with_spice(data_folder: Path) -> None:
    """The label's sub-points and sub-solar points, through our rotation model, against trajectory kernels."""
    from catalog.spice_pose import pose_parts_from_spice

    frame = read_frame(data_folder / "images" / "galileo" / "C0552809300R.IMG")
    camera, target = find_camera("galileo-ssi"), find_target("europa")
    label = initial_pose(frame, camera, target, []).pose
    spice = pose_parts_from_spice(camera, target, label.et, [data_folder / "kernels"]).parts
    for name in ("target_from_spacecraft_km", "sun_from_target_km"):
        ours, theirs = getattr(label, name), getattr(spice, name)
        apart = np.degrees(np.linalg.norm(ours / np.linalg.norm(ours) - theirs / np.linalg.norm(theirs)))
        print(f"{name}: {apart:.4f} deg apart")
        assert apart < 0.05


def test_lorri_header_gives_the_pose_and_the_catalog_the_bodys_attitude(data_folder: Path) -> None:
    frame = read_frame(data_folder / "images" / "new_horizons" / "lor_0299140073_0x630_sci.fit")
    camera = find_camera("newhorizons-lorri")
    found = initial_pose(frame, camera, find_target("pluto"), [])
    spacecraft = _sub_point_west(found.pose.spacecraft_in_body_km)
    sun = _sub_point_west(found.pose.sun_direction_in_body)
    x, y = camera.project(found.pose.target_in_camera_km)
    print(f"sub-spacecraft {spacecraft}, sub-solar {sun}, centre column {x:.2f} row {1023 - y:.2f} (header 732, 749)")
    assert found.sources["body_from_j2000"] == "catalog"
    assert found.pose.range_km == pytest.approx(556158.655624, abs=1e-3)
    assert spacecraft == pytest.approx((42.28773865764265, 360 - 174.2955463667606), abs=1e-3)
    assert sun == pytest.approx((51.55229665818224, 360 - 154.1938853358654), abs=1e-3)
    assert (x, 1023 - y) == pytest.approx((732, 749), abs=4)


def test_cassini_without_kernels_is_refused_naming_kernels_and_pose_file(data_folder: Path) -> None:
    frame = read_frame(data_folder / "images" / "cassini" / "N1489034146_2.IMG")
    with pytest.raises(RefusedError) as refusal:
        initial_pose(frame, find_camera("cassini-nac"), find_target("enceladus"), [])
    print(refusal.value.reason)
    for word in ("pose-unknown", "camera_from_j2000", "cas_iss_v10.ti", "--kernels", "--pose"):
        assert word in refusal.value.reason


def test_cassini_with_the_wrong_missions_kernels_is_reported_what_they_lack(data_folder: Path) -> None:
    frame = read_frame(data_folder / "images" / "cassini" / "N1489034146_2.IMG")
    with pytest.raises(RefusedError, match=r"SPK: position of enceladus, no loaded SPK covers NAIF bodies -82, 602"):
        initial_pose(frame, find_camera("cassini-nac"), find_target("enceladus"), [data_folder / "kernels"])
