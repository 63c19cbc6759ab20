"""Poses in the geometry classes of PDS4 labels."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from catalog.camera import Camera, camera_from_dict
from catalog.celestial import orientation_of_twist
from catalog.flips import Flip
from catalog.pds4_geometry import pds4_label_beside, pose_from_pds4
from catalog.pose import PartialPose

CONTENT = {"name": "c", "size_px": (400, 400), "centre_px": (180.0, 210.0), "focal_length_px": 8000.0}
SIZE = (400, 400)
ORIENTATION = Rotation.random(random_state=7).as_matrix()
SUN_TO_TARGET = np.array([1.8e9, -5.79e9, -2.27e9])


def camera() -> Camera:
    return camera_from_dict(CONTENT, "c")


def vector(name: str, km: np.ndarray, unit: str = "km") -> str:
    axes = "".join(f'<geom:{axis}_position unit="{unit}">{value!r}</geom:{axis}_position>'
                   for axis, value in zip("xyz", km.tolist(), strict=True))  # fmt: skip
    correction = "<geom:light_time_correction_applied>None</geom:light_time_correction_applied>"
    return f"<geom:{name}>{axes}{correction}</geom:{name}>"


def label_text(orientation: np.ndarray = ORIENTATION, sign: float = 1.0, vertical: str = "Top to Bottom") -> str:
    """A label of a picture: centre's right ascension and declination, and the clock angle of celestial north: from up,
    clockwise."""
    ray = camera().detector_ray(np.array([199.5, 199.5]))
    sky = orientation.T @ ray
    north = np.array([0.0, 0.0, 1.0]) - sky[2] * sky
    # the picture's plane at its centre: the camera's axes, turned by the smallest rotation
    turn = Rotation.align_vectors([ray], [[0.0, 0.0, 1.0]])[0].as_matrix()
    right, down = turn[:, 0], turn[:, 1]
    seen = orientation @ north
    clock = float(np.degrees(np.arctan2(seen @ right, -(seen @ down))) % 360)
    ra, dec = float(np.degrees(np.arctan2(sky[1], sky[0])) % 360), float(np.degrees(np.arcsin(sky[2])))
    target = sign * (orientation.T @ np.array([0.01, 0.0, 1.0]) * 17000.0)
    return f"""<?xml version="1.0"?>
<Product_Observational xmlns="http://pds.nasa.gov/pds4/pds/v1" xmlns:geom="http://pds.nasa.gov/pds4/geom/v1"
 xmlns:disp="http://pds.nasa.gov/pds4/disp/v1"><File><file_name>picture.fit</file_name></File>
<disp:Display_Direction><disp:horizontal_display_direction>Left to Right</disp:horizontal_display_direction>
<disp:vertical_display_direction>{vertical}</disp:vertical_display_direction></disp:Display_Direction>
<geom:Object_Orientation_RA_Dec><geom:right_ascension_angle unit="deg">{ra!r}</geom:right_ascension_angle>
<geom:declination_angle unit="deg">{dec!r}</geom:declination_angle>
<geom:celestial_north_clock_angle unit="deg">{clock!r}</geom:celestial_north_clock_angle>
<geom:Reference_Frame_Identification><geom:name>EME J2000</geom:name></geom:Reference_Frame_Identification>
</geom:Object_Orientation_RA_Dec>
{vector("Vector_Cartesian_Position_Spacecraft_To_Target", target)}
{vector("Vector_Cartesian_Position_Sun_To_Target", sign * SUN_TO_TARGET)}
</Product_Observational>"""


def read(folder: Path, text: str, flip: Flip | None = None) -> tuple[PartialPose, tuple[str, ...]]:
    path = folder / "picture.xml"
    path.write_text(text)
    return pose_from_pds4(path, camera(), SIZE, flip)


def test_a_label_gives_orientation_and_positions(tmp_path: Path) -> None:
    parts, faults = read(tmp_path, label_text())
    assert not faults
    assert parts.camera_from_j2000 == pytest.approx(ORIENTATION, abs=1e-9)
    assert parts.target_from_spacecraft_km == pytest.approx(ORIENTATION.T @ [170.0, 0.0, 17000.0], abs=1e-6)
    assert parts.sun_from_target_km == pytest.approx(-SUN_TO_TARGET)


def test_the_sun_by_way_of_the_spacecraft(tmp_path: Path) -> None:
    text = label_text().replace("Position_Sun_To_Target", "Position_Sun_To_Spacecraft")
    parts, _ = read(tmp_path, text)
    assert parts.target_from_spacecraft_km is not None
    assert parts.sun_from_target_km is not None
    assert parts.sun_from_target_km == pytest.approx(-SUN_TO_TARGET - parts.target_from_spacecraft_km)


def test_vectors_with_reversed_signs_are_not_assumed(tmp_path: Path) -> None:
    """As those of a New Horizons label of 2019 are."""
    parts, faults = read(tmp_path, label_text(sign=-1.0))
    assert parts.target_from_spacecraft_km is None
    assert parts.sun_from_target_km is None
    assert "180 deg from where" in faults[0]


def test_a_picture_displayed_upwards_must_have_been_turned(tmp_path: Path) -> None:
    text = label_text(vertical="Bottom to Top")
    parts, faults = read(tmp_path, text)
    assert parts.camera_from_j2000 is None
    assert "see --flip" in faults[0]
    assert parts.target_from_spacecraft_km is not None
    assert read(tmp_path, text, "y")[0].camera_from_j2000 == pytest.approx(ORIENTATION, abs=1e-9)
    assert read(tmp_path, label_text(), "y")[0].camera_from_j2000 is None


@pytest.mark.parametrize(
    ("old", "new", "fault"),
    [
        ("EME J2000", "ECLIPDATE", "not said to be in J2000"),
        ("<geom:Reference_Frame_Identification>", "<geom:reference_pixel_location>Upper Left Corner"
         "</geom:reference_pixel_location><geom:Reference_Frame_Identification>", "not that of the picture's centre"),
        ("declination_angle", "other_angle", "no right ascension and declination"),
        ("celestial_north_clock_angle", "other_angle", "clock angle"),
        ('unit="km"', 'unit="furlong"', "no position of the target"),
        ("Position_Sun_To_Target", "Position_Sun_To_Comet", "no position of the Sun"),
        ("Object_Orientation_RA_Dec", "Other", "has no Object_Orientation_RA_Dec"),
        ("</Product_Observational>", "", "cannot be read"),
        ("<Product", "<!DOCTYPE a><Product", "document type"),
    ],
)  # fmt: skip
def test_what_a_label_lacks_is_named(old: str, new: str, fault: str, tmp_path: Path) -> None:
    _, faults = read(tmp_path, label_text().replace(old, new))
    assert any(fault in each for each in faults), faults


def test_the_label_is_the_file_itself_or_beside_it(tmp_path: Path) -> None:
    label = tmp_path / "picture.xml"
    label.write_text(label_text())
    assert pds4_label_beside(label) == label
    assert pds4_label_beside(tmp_path / "picture.fit") == label
    assert pds4_label_beside(tmp_path / "other.fit") is None


def test_the_clock_angle_of_a_real_label_agrees_with_its_sun_and_its_quaternion() -> None:
    """New Horizons, MVIC, Arrokoth (mc0_0408625487_0x545_sci): right ascension and declination are rounded to 0.1 deg;
    the quaternion is that of the instrument's frame, whose axes are the picture's in another order."""
    orientation = orientation_of_twist(276.8, -33.8, 270.0 - 351.57838)
    sun = orientation @ [-1801956296.599184, 5789592074.710976, 2269532636.079516]
    assert np.degrees(np.arctan2(sun[0], -sun[1])) == pytest.approx(133.8, abs=0.2)
    quaternion = [0.5793975569923115, 0.3215769780838686, 0.6677051115334547, 0.3391999442067836]
    axes = np.abs(orientation @ Rotation.from_quat(quaternion).as_matrix())
    assert np.sort(axes, axis=1) == pytest.approx(np.array([[0.0, 0.0, 1.0]] * 3), abs=2e-3)


def test_the_orientation_is_that_of_a_windows_centre(tmp_path: Path) -> None:
    """A window of the frame: the label's right ascension and declination are those of the window's centre."""
    path = tmp_path / "picture.xml"
    path.write_text(label_text())  # of the frame's centre, (199.5, 199.5)
    first = (150, 120)
    parts, _ = pose_from_pds4(path, camera(), (100, 80), None, first_px=first)
    assert parts.camera_from_j2000 is not None
    sky = ORIENTATION.T @ camera().detector_ray(np.array([199.5, 199.5]))
    centre = np.array(first) + (np.array([100, 80]) - 1) / 2
    assert parts.camera_from_j2000.T @ camera().detector_ray(centre) == pytest.approx(sky, abs=1e-12)
