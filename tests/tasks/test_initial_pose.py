"""The initial pose takes each part from the best source, and refuses with words that help."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from catalog.camera import find_camera
from catalog.errors import RefusedError
from catalog.observation import Frame, Observation
from catalog.pose import PartialPose, Pose
from catalog.rotation import rotation_from_vector_deg
from catalog.target import find_target
from tasks.ingest.pose import initial_pose
from tasks.priors import SourcePriors

ET = 6.0e8
CAMERA = find_camera("cassini-nac")
TARGET = find_target("enceladus")
LIGHT_TIME_S = 1e6 / 299792.458


def _frame(**changes: Any) -> Frame:
    pixels = np.zeros((4, 4), np.float32)
    observation = Observation(pixels, pixels + 1, np.zeros((4, 4), np.uint16))
    frame = Frame("N1", Path("N1.IMG"), "0" * 64, "test", observation, camera=CAMERA.name, et=ET)
    return frame.replaced(**changes)


def _pose() -> Pose:
    return Pose(
        et=ET,
        camera_from_j2000=rotation_from_vector_deg([10, 20, 30]),
        target_from_spacecraft_km=np.array([0.0, 6e5, 8e5]),
        sun_from_target_km=np.array([1e9, 0, 1e8]),
        body_from_j2000=rotation_from_vector_deg([-40, 5, 80]),
    )


def _pose_file(folder: Path, *keys: str, **changes: Any) -> Path:
    content = {key: value for key, value in _pose().to_dict().items() if key in keys}
    path = folder / "pose.json"
    path.write_text(json.dumps({**content, **changes}))
    return path


GEOMETRY_KEYS = ("camera_from_j2000", "target_from_spacecraft_km", "sun_from_target_km", "body_from_j2000")


def test_a_complete_pose_file_is_used_as_it_stands(tmp_path: Path) -> None:
    found = initial_pose(_frame(), CAMERA, TARGET, [], _pose_file(tmp_path, "et", *GEOMETRY_KEYS))
    assert found.source == "file"
    assert set(found.sources.values()) == {"file"}
    assert found.pose.to_dict() == _pose().to_dict()


def test_the_time_of_the_pose_file_overrides_the_labels(tmp_path: Path) -> None:
    path = _pose_file(tmp_path, *GEOMETRY_KEYS, et=ET + 7)
    assert initial_pose(_frame(), CAMERA, TARGET, [], path).pose.et == ET + 7


def test_without_kernels_the_bodys_attitude_comes_from_the_catalog_at_the_time_the_light_left(tmp_path: Path) -> None:
    found = initial_pose(_frame(), CAMERA, TARGET, [], _pose_file(tmp_path, *GEOMETRY_KEYS[:3]))
    assert found.sources["body_from_j2000"] == "catalog"
    assert TARGET.rotation is not None
    expected = TARGET.rotation.body_from_j2000(ET - LIGHT_TIME_S)
    np.testing.assert_allclose(found.pose.body_from_j2000, expected, atol=1e-12)


def test_the_pose_file_wins_over_the_label_part_by_part(tmp_path: Path) -> None:
    label = PartialPose.from_dict(_pose().to_dict())
    turned = rotation_from_vector_deg([0, 0, 3])
    path = _pose_file(tmp_path, camera_from_j2000=turned.tolist())
    found = initial_pose(_frame(label_pose=label), CAMERA, TARGET, [], path)
    assert found.sources == {key: "file" if key == "camera_from_j2000" else "label" for key in GEOMETRY_KEYS}
    np.testing.assert_array_equal(found.pose.camera_from_j2000, turned)
    np.testing.assert_array_equal(found.pose.body_from_j2000, _pose().body_from_j2000)


def test_no_source_at_all_is_refused_naming_parts_kernels_and_the_pose_file() -> None:
    with pytest.raises(RefusedError) as refusal:
        initial_pose(_frame(), CAMERA, TARGET, [])
    assert refusal.value.code == "pose-unknown"
    for word in (
        "camera_from_j2000",
        "sun_from_target_km",
        "no kernels are loaded",
        "cas_v43.tf",
        "give a pose file (--pose)",
        "--pose image",
    ):
        assert word in refusal.value.reason


def test_a_pose_file_whose_two_times_differ_is_refused_and_not_half_used(tmp_path: Path) -> None:
    times = ("et", "utc", *GEOMETRY_KEYS)
    assert initial_pose(_frame(), CAMERA, TARGET, [], _pose_file(tmp_path, *times)).pose.et == ET
    with pytest.raises(RefusedError, match=r"pose\.json: utc .* and et .* are not the same time .* leave one out"):
        initial_pose(_frame(), CAMERA, TARGET, [], _pose_file(tmp_path, *times, et=ET + 7))
    with pytest.raises(RefusedError, match=r"pose\.json: .yesterday. is no UTC such as"):
        initial_pose(_frame(), CAMERA, TARGET, [], _pose_file(tmp_path, *times, utc="yesterday"))


def test_a_frame_without_time_is_refused() -> None:
    with pytest.raises(RefusedError, match=r"no time.*--pose"):
        initial_pose(_frame(et=None), CAMERA, TARGET, [])


def test_a_pose_file_with_a_matrix_that_is_no_rotation_is_refused(tmp_path: Path) -> None:
    skewed = np.eye(3)
    skewed[0, 1] = 0.01
    path = _pose_file(tmp_path, *GEOMETRY_KEYS[1:], camera_from_j2000=skewed.tolist())
    with pytest.raises(RefusedError, match=r"pose\.json.*camera_from_j2000 is not orthonormal"):
        initial_pose(_frame(), CAMERA, TARGET, [], path)


LABEL_GEOMETRY = {
    "distance_km": 5e5,
    "sub_spacecraft_lat_deg": 10.0,
    "sub_spacecraft_lon_deg": 200.0,
    "sub_solar_lat_deg": -5.0,
    "sub_solar_lon_deg": 150.0,
    "north_azimuth_deg": 260.0,
    "centre_x_px": 400.0,
    "centre_y_px": 300.0,
    "solar_distance_km": 1.4e9,
}


def test_an_orientation_from_label_geometry_brings_the_labels_whole_geometry() -> None:
    found = initial_pose(_frame(label_geometry=LABEL_GEOMETRY), CAMERA, TARGET, [])
    assert found.source == "label"
    assert set(found.sources.values()) == {"label"}
    np.testing.assert_allclose(CAMERA.project(found.pose.target_in_camera_km), [400, 300], atol=1e-6)
    assert found.pose.range_km == pytest.approx(5e5)


def test_faulty_label_geometry_does_not_stop_a_complete_pose_file(tmp_path: Path) -> None:
    frame = _frame(label_geometry={**LABEL_GEOMETRY, "distance_km": float("nan")})
    found = initial_pose(frame, CAMERA, TARGET, [], _pose_file(tmp_path, "et", *GEOMETRY_KEYS))
    assert found.source == "file"
    assert any("distance_km" in text for text in found.missing)


def test_faulty_label_geometry_alone_is_refused_with_its_fault() -> None:
    with pytest.raises(RefusedError, match=r"label lacks distance_km"):
        initial_pose(_frame(label_geometry={**LABEL_GEOMETRY, "distance_km": float("nan")}), CAMERA, TARGET, [])


PDS4 = """<?xml version="1.0"?><Product_Observational xmlns:geom="http://pds.nasa.gov/pds4/geom/v1">
<geom:Object_Orientation_RA_Dec><geom:right_ascension_angle unit="deg">0.0</geom:right_ascension_angle>
<geom:declination_angle unit="deg">0.0</geom:declination_angle>
<geom:celestial_north_clock_angle unit="deg">90.0</geom:celestial_north_clock_angle>
<geom:Reference_Frame_Identification><geom:name>J2000</geom:name></geom:Reference_Frame_Identification>
</geom:Object_Orientation_RA_Dec>
<geom:Vector_Cartesian_Position_Spacecraft_To_Target><geom:x_position unit="km">500000.0</geom:x_position>
<geom:y_position unit="km">10.0</geom:y_position><geom:z_position unit="km">0.0</geom:z_position>
</geom:Vector_Cartesian_Position_Spacecraft_To_Target>
<geom:Vector_Cartesian_Position_Sun_To_Target><geom:x_position unit="AU">9.0</geom:x_position>
<geom:y_position unit="AU">1.0</geom:y_position><geom:z_position unit="AU">0.0</geom:z_position>
</geom:Vector_Cartesian_Position_Sun_To_Target></Product_Observational>"""


def test_the_geometry_of_a_pds4_label_serves_where_nothing_better_does(tmp_path: Path) -> None:
    (tmp_path / "N1.xml").write_text(PDS4)
    frame = _frame(path=tmp_path / "N1.IMG")
    found = initial_pose(frame, CAMERA, TARGET, [])
    assert found.sources == {key: "catalog" if key == "body_from_j2000" else "pds4" for key in GEOMETRY_KEYS}
    # seen along +x of J2000, north to the right: then y of J2000 (east) is up
    by_rows = found.pose.camera_from_j2000 @ np.eye(3)
    assert by_rows[0] == pytest.approx([0, 0, 1], abs=0.06)  # four pixels are a corner of this camera's field
    assert by_rows[1] == pytest.approx([0, -1, 0], abs=0.06)
    assert found.pose.target_from_spacecraft_km == pytest.approx([5e5, 10, 0])
    by_file = initial_pose(frame, CAMERA, TARGET, [], _pose_file(tmp_path, *GEOMETRY_KEYS))
    assert set(by_file.sources.values()) == {"file"}
    assert SourcePriors().of(found.sources).range_km == 50.0
