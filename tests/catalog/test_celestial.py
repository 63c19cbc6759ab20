"""Orientations on the sky: twist, and FITS world coordinates against astropy, for every flip."""

from typing import Any

import numpy as np
import pytest
from astropy.coordinates import FK4, ICRS, BarycentricMeanEcliptic, Galactic, SkyCoord
from astropy.wcs import WCS
from scipy.spatial.transform import Rotation

from catalog.camera import Camera, camera_from_dict
from catalog.celestial import orientation_of_twist, orientation_of_wcs, twist_fault, twist_of_label
from catalog.errors import RefusedError
from catalog.flips import PLACES, Flip
from catalog.target import find_target

CONTENT = {"name": "c", "size_px": (400, 400), "centre_px": (180.0, 210.0), "focal_length_px": 40000.0}


def camera() -> Camera:
    return camera_from_dict(CONTENT, "c")


def header_of(orientation: np.ndarray, flip: Flip | None) -> dict[str, Any]:
    """A header whose world coordinates are those of the camera in `orientation`, of the file before `flip`."""
    boresight = SkyCoord(*(orientation[2]), representation_type="cartesian").spherical
    ra, dec = boresight.lon.deg, boresight.lat.deg
    east = np.array([-np.sin(np.radians(ra)), np.cos(np.radians(ra)), 0])
    north = np.cross(orientation[2], east)
    sky_from_camera = np.array([[east @ orientation[0], east @ orientation[1]],
                                [north @ orientation[0], north @ orientation[1]]])  # fmt: skip
    middle = np.array([199.5, 199.5])
    centre = np.array([180.0, 210.0]) - middle
    if flip is not None:  # places of the picture are PLACES @ places of the file
        sky_from_camera = sky_from_camera @ PLACES[flip]
        centre = np.linalg.inv(PLACES[flip]) @ centre
    cd = np.degrees(sky_from_camera / 40000.0)
    crpix = centre + middle + 1
    return {
        "CTYPE1": "RA---TAN", "CTYPE2": "DEC--TAN", "CRVAL1": ra, "CRVAL2": dec, "CRPIX1": crpix[0],
        "CRPIX2": crpix[1], "CD1_1": cd[0, 0], "CD1_2": cd[0, 1], "CD2_1": cd[1, 0], "CD2_2": cd[1, 1],
        "CUNIT1": "deg", "CUNIT2": "deg", "RADESYS": "ICRS", "COMMENT": "x", "EXPTIME": 1.0,
    }  # fmt: skip


@pytest.mark.parametrize("flip", [None, "x", "y", "rot90", "rot180", "rot270", "transpose", "antitranspose"])
@pytest.mark.parametrize("seed", [1, 2])
def test_world_coordinates_give_the_orientation(flip: Flip | None, seed: int) -> None:
    orientation = Rotation.random(random_state=seed).as_matrix()
    found = orientation_of_wcs(header_of(orientation, flip), camera(), (400, 400), flip)
    assert found is not None
    assert np.degrees(np.linalg.norm(found @ orientation.T - np.eye(3))) < 1e-6


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("name", ["equatorial", "galactic", "ecliptic", "of 1950"])
def test_world_coordinates_of_other_skies_and_axes(name: str, turned: bool) -> None:
    """The same places as astropy gives them in that frame, with either coordinate as the first axis."""
    orientation = Rotation.random(random_state=6).as_matrix()
    header: dict[str, Any] = header_of(orientation, None)
    frame, kinds, more = {
        "equatorial": (ICRS(), ("RA---TAN", "DEC--TAN"), {}),
        "galactic": (Galactic(), ("GLON-TAN", "GLAT-TAN"), {}),
        "ecliptic": (BarycentricMeanEcliptic(), ("ELON-TAN", "ELAT-TAN"), {"EQUINOX": 2000.0}),
        "of 1950": (FK4(equinox="B1950"), ("RA---TAN", "DEC--TAN"), {"RADESYS": "FK4", "EQUINOX": 1950.0}),
    }[name]
    sky = SkyCoord(*(orientation[2]), representation_type="cartesian", frame="icrs").transform_to(frame)
    # the frame's axes near the boresight, as their differences over 1e-4 of a radian
    near = [SkyCoord(*row, representation_type="cartesian", frame="icrs").transform_to(frame) for row in
            orientation[2] + 1e-4 * orientation[:2]]  # fmt: skip
    offsets = np.array([[each.degree for each in sky.spherical_offsets_to(one)] for one in near]).T
    matrix = offsets / 1e-4 / 40000.0
    values = [sky.spherical.lon.deg, sky.spherical.lat.deg]
    order = [1, 0] if turned else [0, 1]
    for axis, place in enumerate(order, 1):
        header |= {f"CTYPE{axis}": kinds[place], f"CRVAL{axis}": values[place]}
        header |= {f"CD{axis}_1": matrix[place, 0], f"CD{axis}_2": matrix[place, 1]}
    found = orientation_of_wcs(header | more, camera(), (400, 400))
    assert found is not None
    assert np.degrees(np.linalg.norm(found @ orientation.T - np.eye(3))) < 1e-4


def test_rows_that_the_reader_reversed_are_taken_back() -> None:
    orientation = Rotation.random(random_state=3).as_matrix()
    header = header_of(orientation, "y") | {"ROWS_REVERSED_BY_READER": True}
    found = orientation_of_wcs(header, camera(), (400, 400))
    assert found == pytest.approx(orientation, abs=1e-7)


def test_a_mirrored_picture_and_another_scale_are_named() -> None:
    orientation = Rotation.random(random_state=4).as_matrix()
    with pytest.raises(RefusedError, match="mirrored"):
        orientation_of_wcs(header_of(orientation, "y"), camera(), (400, 400))
    other = camera_from_dict(CONTENT | {"focal_length_px": 20000.0}, "c")
    with pytest.raises(RefusedError, match=r"pixels 0\.500 times"):
        orientation_of_wcs(header_of(orientation, None), other, (400, 400))


def test_a_header_without_or_with_damaged_coordinates() -> None:
    assert orientation_of_wcs({"CTYPE1": "WAVE"}, camera(), (400, 400)) is None
    header = header_of(np.eye(3), None) | {"CTYPE2": "NONSENSE"}
    with pytest.raises(RefusedError, match="world coordinates"):
        orientation_of_wcs(header, camera(), (400, 400))


def test_the_helper_of_these_tests_agrees_with_astropy() -> None:
    orientation = Rotation.random(random_state=5).as_matrix()
    header = {key: value for key, value in header_of(orientation, None).items() if key != "COMMENT"}
    sky = WCS(header).pixel_to_world([250.0], [100.0])
    ray = orientation.T @ camera().ray([250.0, 100.0])
    assert sky.icrs.cartesian.xyz.value[:, 0] == pytest.approx(ray, abs=1e-9)


def test_twist_gives_a_right_handed_frame_about_the_boresight() -> None:
    turned = orientation_of_twist(114.967, 23.9387, 261.906)
    assert turned @ turned.T == pytest.approx(np.eye(3), abs=1e-12)
    assert np.linalg.det(turned) == pytest.approx(1.0)
    again = orientation_of_twist(114.967, 23.9387, 271.906)
    assert np.degrees(np.arccos(again[0] @ turned[0])) == pytest.approx(10.0)


LABEL = {"RA": 114.967, "DEC": 23.9387, "TWIST": 261.906, "NORAZ": 267.076}


def test_a_twist_is_used_only_where_the_north_azimuth_agrees() -> None:
    """Galileo C0552809300R, Europa, 2000-05-22T23:52:05.277."""
    europa, et, turned = find_target("europa"), 12354789.46, twist_of_label(LABEL)
    assert turned is not None
    assert twist_fault(LABEL, turned, europa, et) is None
    assert "NORAZ" in str(twist_fault(LABEL | {"NORAZ": 87.0}, turned, europa, et))
    assert twist_fault(LABEL | {"NORAZ": -999.0}, turned, europa, et) is None


@pytest.mark.parametrize(
    "changes", [{"RA": 0.0, "DEC": 0.0, "TWIST": 0.0}, {"RA": -999.0}, {"DEC": None}, {"TWIST": "x"}]
)
def test_a_twist_that_is_not_known_gives_nothing(changes: dict[str, Any]) -> None:
    assert twist_of_label(LABEL | changes) is None


@pytest.mark.parametrize(
    ("changes", "fault"),
    [
        ({"CRVAL1": None}, "lack CRVAL1"),
        ({"CRPIX2": "x"}, "lack CRPIX2"),
        ({"CRVAL2": float("nan")}, "cannot be read"),
        ({"RADESYS": "GAPPT"}, "RADESYS = GAPPT is no frame"),
        ({"CD1_1": None, "CD1_2": None}, "neither CD1_1 nor CDELT1"),
        ({"CD1_1": 0.0, "CD1_2": 0.0}, r"cannot be read \(PCi_ja matrix is singular"),
        ({"CTYPE1": "RA---SIN", "CTYPE2": "DEC--SIN", "CD1_1": 1.0, "CD2_2": 1.0}, "no place on the sky"),
    ],
)
def test_coordinates_that_say_no_place_are_named(changes: dict[str, Any], fault: str) -> None:
    header = header_of(Rotation.random(random_state=4).as_matrix(), None) | changes
    with pytest.raises(RefusedError, match=fault):
        orientation_of_wcs({key: value for key, value in header.items() if value is not None}, camera(), (400, 400))
