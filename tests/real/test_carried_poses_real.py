"""Poses that files carry: ISIS cubes after spiceinit, ISDs, FITS headers and Galileo labels."""

import bz2
import gzip
import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from catalog.camera import Camera, find_camera
from catalog.errors import RefusedError
from catalog.isd import pose_from_isd
from catalog.isis_tables import cube_label, has_pose, is_isis_cube, pose_from_cube
from catalog.made_camera import camera_carried_by
from catalog.readers import read_frame
from catalog.target import find_target
from tasks.ingest.carried import orientation_of_header, parts_of_pose_file, parts_of_tables
from tasks.ingest.pose import initial_pose

CUBES = {
    "isd/EN1072174528M/EN1072174528M.cub": "isd/EN1072174528M/messmdis_isis_isd.json",
    "isd/f004a47/f004a47.cub": "isd/f004a47/f004a47_isd.json",
    "isd/f704b28/f704b28.cub": "isd/f704b28/f704b28_isd.json",
}


def apart_deg(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.degrees(np.linalg.norm(a @ b.T - np.eye(3)) / np.sqrt(2)))


ISDS = {
    "c1637937/c1637937_isd.json": 599, "c2065801/c2065801_isd.json": 599, "E6I0032/galileossi_isd.json": 501,
    "lor_0034974380_0x630_sci_1/nhlorri_isd.json": 501, "mpf_0295610274_0x539_sci/mvic_mpf_isd.json": 999,
}  # fmt: skip


@pytest.mark.parametrize("name", ISDS)
def test_the_body_is_turned_as_it_was_when_its_light_left(name: str, data_folder: Path) -> None:
    """ISIS and ALE give it at the exposure: 0.1 deg later for Pluto at 164 light seconds."""
    import spiceypy

    from catalog.spice import kernel_pool

    path, body = data_folder / "isd" / name, ISDS[name]
    pose = pose_from_isd(path).completed()
    with kernel_pool(sorted((path.parent / "kernels").glob("pck*.tpc"))):
        seen = spiceypy.tipbod("J2000", body, pose.et - pose.range_km / 299792.458)
        arrived = spiceypy.tipbod("J2000", body, pose.et)
    assert apart_deg(pose.body_from_j2000, seen) < 2e-5
    assert apart_deg(pose.body_from_j2000, arrived) > 5e-3


@pytest.mark.parametrize("name", CUBES)
def test_a_cubes_tables_hold_the_pose_that_ale_makes_of_them(name: str, data_folder: Path) -> None:
    cube, isd = pose_from_cube(data_folder / name), pose_from_isd(data_folder / CUBES[name]).completed()
    assert cube.et == pytest.approx(isd.et, abs=1e-3)
    pose = cube.completed()
    assert apart_deg(pose.camera_from_j2000, isd.camera_from_j2000) < 1e-4  # times differ by up to 0.4 ms
    assert apart_deg(pose.body_from_j2000, isd.body_from_j2000) < 1e-5
    assert pose.target_from_spacecraft_km == pytest.approx(isd.target_from_spacecraft_km, rel=1e-5, abs=0.01)
    assert pose.sun_from_target_km == pytest.approx(isd.sun_from_target_km, rel=1e-6, abs=50.0)


def test_a_cube_carries_its_camera(data_folder: Path) -> None:
    made = Camera.from_cube(data_folder / "isd/EN1072174528M/EN1072174528M.cub")
    kernels = data_folder / "isd/EN1072174528M/kernels"
    wanted = Camera.from_kernels([kernels], "MSGR_MDIS_NAC", temperature_c=4.07)
    pixels = np.random.default_rng(3).uniform(0, 1023, (50, 2))
    assert np.abs(made.project(wanted.detector_ray(pixels)) - made.project(made.detector_ray(pixels))).max() < 0.01
    assert find_camera(f"isis:{data_folder}/isd/EN1072174528M/EN1072174528M.cub") == made


OTHERS = ("20190425T211232S312_map_iofL2pan-crop", "20200303T213031S138_ncm_L0-reduced", "EW0131773041G.cal.crop")


@pytest.mark.parametrize("name", OTHERS)
def test_cubes_of_other_missions_have_poses_and_cameras(name: str, data_folder: Path) -> None:
    path = data_folder / "images/others/isis" / f"{name}.cub"
    assert is_isis_cube(path)
    assert has_pose(cube_label(path))
    pose, camera = pose_from_cube(path).completed(), Camera.from_cube(path)
    assert pose.range_km > 0.2
    pixels = np.random.default_rng(3).uniform(0, 1, (50, 2)) * np.array(camera.detector_size_px)
    assert camera.detector_pixel(camera.detector_ray(pixels)) == pytest.approx(pixels, abs=1e-6)


@pytest.mark.parametrize("pack", [gzip.compress, bz2.compress])
def test_a_packed_cube_carries_its_pose_and_its_camera(pack: Any, data_folder: Path, tmp_path: Path) -> None:
    plain = data_folder / "images/others/isis" / f"{OTHERS[0]}.cub"
    packed = tmp_path / "a.cub.packed"
    packed.write_bytes(pack(plain.read_bytes()))
    name, why_not = camera_carried_by(packed)
    assert (name, why_not) == (f"isis:{packed}", None)
    assert find_camera(str(name)).model_copy(update={"sources": Camera.from_cube(plain).sources}) == Camera.from_cube(
        plain
    )
    frames = [read_frame(path) for path in (plain, packed)]
    assert frames[0].et is not None
    (there, _), (here, faults) = (parts_of_tables(frame, float(frames[0].et)) for frame in frames)
    assert faults == ()
    np.testing.assert_array_equal(here.camera_from_j2000, there.camera_from_j2000)
    np.testing.assert_array_equal(here.target_from_spacecraft_km, there.target_from_spacecraft_km)


def test_a_cut_or_damaged_table_is_named(data_folder: Path, tmp_path: Path) -> None:
    source = data_folder / "isd/f004a47/f004a47.cub"
    whole = source.read_bytes()
    cut = tmp_path / "cut.cub"
    cut.write_bytes(whole[:65600])
    with pytest.raises(RefusedError, match="cut short"):
        pose_from_cube(cut)
    at = whole.index(b"Name                = InstrumentPointing")
    start = int(whole[at:].split(b"StartByte")[1].split(b"=")[1].split()[0]) - 1
    damaged = tmp_path / "damaged.cub"
    damaged.write_bytes(whole[:start] + b"\xff" * 8 + whole[start + 8 :])
    with pytest.raises(RefusedError, match="not finite"):
        pose_from_cube(damaged)
    with pytest.raises(RefusedError, match="it covers et"):
        pose_from_cube(source, 0.0)


def test_an_isd_is_a_pose_file_and_says_so(data_folder: Path) -> None:
    path = data_folder / "isd/E6I0032/galileossi_isd.json"
    source, parts = parts_of_pose_file(path)
    assert source == "isd"
    assert parts.missing() == []


def test_an_isd_in_body_fixed_metres_gives_the_same_pose(data_folder: Path, tmp_path: Path) -> None:
    """USGSCSM's own form, made here from ALE's of Io: quaternions (x, y, z, scalar) from sensor to body."""
    path, io = data_folder / "isd/E6I0032/galileossi_isd.json", find_target("io")
    pose = pose_from_isd(path).completed()
    body = io.rotation.body_from_j2000(pose.et - pose.range_km / 299792.458)  # type: ignore[union-attr]
    content = json.loads(path.read_text())
    for name in ("instrument_pointing", "instrument_position", "body_rotation"):
        del content[name]
    spacecraft, sun = body @ -pose.target_from_spacecraft_km, body @ pose.sun_from_target_km
    quaternion = Rotation.from_matrix(body @ pose.camera_from_j2000.T).as_quat()
    content["sensor_position"] = {"positions": [(spacecraft * 1e3).tolist()], "unit": "m"}
    content["sun_position"] = {"positions": [(sun * 1e3).tolist()], "unit": "m"}
    content["sensor_orientation"] = {"quaternions": [quaternion.tolist()]}
    file = tmp_path / "isd.json"
    file.write_text(json.dumps(content))
    found = pose_from_isd(file, io).completed()
    assert apart_deg(found.camera_from_j2000, pose.camera_from_j2000) < 1e-9
    assert apart_deg(found.body_from_j2000, pose.body_from_j2000) < 0.01  # ALE: pck00009
    assert found.target_from_spacecraft_km == pytest.approx(pose.target_from_spacecraft_km, rel=1e-12)
    assert found.sun_from_target_km == pytest.approx(pose.sun_from_target_km, rel=1e-12)
    with pytest.raises(RefusedError, match="body-fixed"):
        pose_from_isd(file)


def test_the_isd_of_another_image_is_refused(data_folder: Path) -> None:
    frame = read_frame(data_folder / "images/galileo/C0552809300R.IMG")
    path = data_folder / "isd/E6I0032/galileossi_isd.json"
    with pytest.raises(RefusedError, match=r"is of 1997-02-19.*of 2000-05-22"):
        initial_pose(frame, Camera.from_isd(path), find_target("europa"), [], path)


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"name_model": "USGS_ASTRO_LINE_SCANNER_SENSOR_MODEL"}, "lines have times"),
        ({"focal_length_model": {}}, "focal_length"),
        ({"optical_distortion": {"fisheye": {"coefficients": [1.0]}}}, "fisheye"),
        ({"focal2pixel_lines": [0.0, 0.0, 0.0]}, "isd"),
    ],
)
def test_an_isd_that_makes_no_camera_says_why(
    changes: dict[str, object], named: str, data_folder: Path, tmp_path: Path
) -> None:
    content = json.loads((data_folder / "isd/E6I0032/galileossi_isd.json").read_text()) | changes
    file = tmp_path / "isd.json"
    file.write_text(json.dumps(content))
    with pytest.raises(RefusedError, match=named):
        Camera.from_isd(file)


def test_the_world_coordinates_of_lorri_agree_with_its_quaternion(data_folder: Path) -> None:
    frame = read_frame(data_folder / "images/new_horizons/lor_0299140073_0x630_sci.fit")
    camera = find_camera("newhorizons-lorri")
    parts, source, faults = orientation_of_header(frame, camera, find_target("pluto"), float(frame.et or 0), None)
    assert (source, faults) == ("wcs", ())
    assert parts.camera_from_j2000 is not None
    # a pixel: the header counts its reference pixel from 0
    assert apart_deg(parts.camera_from_j2000, np.asarray(frame.label_pose.camera_from_j2000)) < 5e-4


def test_a_galileo_labels_twist_agrees_with_its_own_geometry(data_folder: Path) -> None:
    frame = read_frame(data_folder / "images/galileo/C0552809300R.IMG")
    camera, europa = find_camera("galileo-ssi"), find_target("europa")
    parts, source, faults = orientation_of_header(frame, camera, europa, float(frame.et or 0), None)
    assert (source, faults) == ("twist", ())
    by_geometry = initial_pose(frame, camera, europa, [])
    assert by_geometry.source == "label"
    assert apart_deg(np.asarray(parts.camera_from_j2000), by_geometry.pose.camera_from_j2000) < 0.01


def test_a_twist_stands_in_where_the_label_has_no_geometry(data_folder: Path) -> None:
    """With a trajectory but no C-kernel; the source is stated."""
    frame = read_frame(data_folder / "images/galileo/C0552809300R.IMG").replaced(label_geometry=None)
    camera, europa = find_camera("galileo-ssi"), find_target("europa")
    kernels = [p for p in sorted((data_folder / "kernels").rglob("*")) if p.is_file() and p.suffix not in (".bc", "")]
    found = initial_pose(frame, camera, europa, [p for p in kernels if p.suffix in (".bsp", ".tls", ".tpc")])
    assert found.sources["camera_from_j2000"] == "twist"
    assert found.sources["target_from_spacecraft_km"] == "spice"
    x, y = camera.project(found.pose.target_in_camera_km)
    assert abs(x - 212) < 40
    assert abs(y - 111) < 40


def test_other_files_have_no_tables(data_folder: Path, tmp_path: Path) -> None:
    frame = read_frame(data_folder / "images/galileo/C0552809300R.IMG")
    assert parts_of_tables(frame, 0.0)[0].missing()[0] == "et"
    copy = tmp_path / "frame.cub"
    shutil.copy(data_folder / "isd/f004a47/f004a47.cub", copy)
    assert parts_of_tables(frame.replaced(path=copy), -742324621.5707)[0].missing() == []
    assert "covers" in parts_of_tables(frame.replaced(path=copy), 0.0)[1][0]
