"""The readers on the real mission files: what each gives, against figures from elsewhere."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from catalog.camera import find_camera
from catalog.errors import RefusedError
from catalog.label_geometry import pose_from_label_geometry
from catalog.observation import Frame, Quality
from catalog.pose import PartialPose
from catalog.readers import read_frame
from catalog.readers.huffman import DIFFERENCES
from catalog.readers.lorri import CAMERA_FROM_NH_LORRI
from catalog.target import known_targets
from catalog.times import et_from_utc, utc_from_et

pytestmark = pytest.mark.real

LORRI = "new_horizons/lor_0299140073_0x630_sci.fit"
FRAMES = {  # file: format, (ny, nx), camera, target, mid-exposure, exposure, undistorted, missing, outside, saturated
    "galileo/C0552809300R.IMG": (
        ("galileo-redr", (800, 800), "galileo-ssi", "europa", "2000-05-22T23:52:05.277", 0.0458333, False),
        (25, 544000, 10),
    ),
    "galileo/C0532836239R.IMG": (
        ("galileo-redr", (800, 800), "galileo-ssi", "europa", "2000-01-03T18:02:23.556", 0.0125003, False),
        (0, 0, 86),
    ),
    "cassini/N1489034146_2.IMG": (
        ("vicar", (1024, 1024), "cassini-nac", "enceladus", "2005-03-09T04:09:09.568", 1.2, False),
        (0, 0, 0),
    ),
    LORRI: (
        ("lorri-fits", (1024, 1024), "newhorizons-lorri", "pluto", "2015-07-14T00:35:54.780", 0.15, False),
        (34, 0, 0),
    ),
    "voyager/f1636832.raw": (
        ("voyager-vicar", (800, 800), "voyager1-nac", "jupiter", "1979-03-04T19:22:59.820", 0.36, False),
        (33, 0, 7719),
    ),
    "voyager/f1636832.fic.vic": (
        ("voyager-vicar", (800, 800), "voyager1-nac", "jupiter", "1979-03-04T19:22:59.820", 0.36, False),
        (0, 0, 31),
    ),
    "voyager/f1636832.geo": (
        ("voyager-vicar", (1000, 1000), "voyager1-nac", "jupiter", "1979-03-04T19:22:59.820", 0.36, True),
        (0, 97952, 1),
    ),
    "voyager/C1124748_RAW.IMG": (
        ("voyager-vicar", (800, 800), "voyager2-nac", "neptune", "1989-08-20T09:56:33.480", 23.04, False),
        (3446, 0, 0),
    ),
    "voyager/C1124748_CLEANED.IMG": (
        ("voyager-vicar", (800, 800), "voyager2-nac", "neptune", "1989-08-20T09:56:33.480", 23.04, False),
        (21, 0, 0),
    ),
    "voyager/C2069302_RAW.IMG": (
        ("voyager-vicar", (800, 800), "voyager2-wac", "jupiter", "1979-07-11T01:19:50.320", 15.36, False),
        (288000, 0, 0),
    ),
    "voyager/C2069302_GEOMED.IMG": (
        ("voyager-vicar", (1000, 1000), "voyager2-wac", "jupiter", "1979-07-11T01:19:50.320", 15.36, True),
        (0, 96116, 0),
    ),
    "voyager/C3580800_RAW.IMG": (
        ("voyager-vicar", (800, 800), "voyager1-nac", "saturn", "1980-12-11T18:57:15.320", 15.36, False),
        (42, 0, 4),
    ),
    "voyager/c4400436.imq": (
        ("voyager-imq", (800, 800), "voyager2-nac", "enceladus", "1981-08-26T02:35:08.940", 0.12, False),
        (62, 0, 1),
    ),
}


def flagged(frame: Frame, flag: Quality) -> int:
    return int(np.count_nonzero(frame.observation.quality & flag))


@pytest.mark.parametrize("name", FRAMES)
def test_every_real_frame_is_read(data_folder: Path, name: str) -> None:
    (form, shape, camera, target, utc, exposure_s, undistorted), counts = FRAMES[name]
    frame = read_frame(data_folder / "images" / name)
    found = tuple(flagged(frame, flag) for flag in (Quality.MISSING, Quality.OUTSIDE_WINDOW, Quality.SATURATED))
    noise = np.median(frame.observation.noise)
    print(
        f"\n{name}: {frame.format} {frame.observation.image.shape} {frame.camera} {frame.target} "
        f"{utc_from_et(frame.et or 0)} {frame.exposure_s} s, filter {frame.filter}, missing/outside/saturated {found}, "
        f"median noise {noise:.2f}"
    )
    assert (frame.format, frame.observation.image.shape) == (form, shape)
    assert (frame.camera, frame.target, frame.undistorted) == (camera, target, undistorted)
    assert frame.et == pytest.approx(et_from_utc(utc), abs=1e-3)
    assert frame.exposure_s == pytest.approx(exposure_s)
    assert found == counts
    assert 0.3 < noise < 20
    assert np.isfinite(frame.observation.image).all()


def test_the_same_voyager_frame_in_three_stages_shows_the_same_disk(data_folder: Path) -> None:
    """Byte orders, prefixes and signs: raw and calibrated pixels of one frame must follow one another."""
    raw, calibrated = (
        read_frame(data_folder / "images/voyager" / name).observation for name in ("f1636832.raw", "f1636832.fic.vic")
    )
    good = (raw.quality == 0) & (calibrated.quality == 0)
    correlation = np.corrcoef(raw.image[good], calibrated.image[good])[0, 1]
    print(f"\ncorrelation of raw and calibrated: {correlation:.5f}")
    assert correlation > 0.99


def test_line_prefixes_are_cut_off_exactly(data_folder: Path) -> None:
    """A prefix byte too many or too few would shift lines: CLEANED has no prefix, RAW has 224 bytes."""
    folder = data_folder / "images/voyager"
    raw, cleaned = (read_frame(folder / f"C1124748_{stage}.IMG").observation for stage in ("RAW", "CLEANED"))
    same = np.mean(raw.image[raw.usable] == cleaned.image[raw.usable])
    print(f"\npixels that RAW and CLEANED share: {same:.4f}")
    assert same > 0.9


def test_the_compressed_image_has_exactly_the_histogram_in_its_file(data_folder: Path) -> None:
    from catalog.readers import imq

    path = data_folder / "images/voyager/c4400436.imq"
    records = imq._records(path)
    label = imq._label(path, records)
    image, missing = imq._image(path, label, records)
    expected = imq._histogram(path, label, "^IMAGE_HISTOGRAM", records, 256)
    assert np.array_equal(np.bincount(image.ravel(), minlength=256), expected)
    assert not missing.any()
    assert imq._histogram(path, label, "^ENCODING_HISTOGRAM", records, DIFFERENCES).sum() > 640_000


def test_lorri_pose_agrees_with_the_headers_own_wcs_and_angles(data_folder: Path) -> None:
    """Orientation by quaternion against the WCS keywords, all over the frame; the header's CRPIX 511.5 counts from 0
    (as the kernel's CCD centre does), although FITS counts from 1."""
    from astropy.io import fits
    from astropy.wcs import WCS

    frame = read_frame(data_folder / "images" / LORRI)
    header = fits.getheader(data_folder / "images" / LORRI)
    rotation = known_targets()["pluto"].rotation
    assert rotation is not None
    body_from_j2000 = rotation.body_from_j2000((frame.et or 0) - header["SPCTRANG"] / 299792.458)
    camera = find_camera("newhorizons-lorri")
    pose = frame.label_pose.filled_from(PartialPose(body_from_j2000=body_from_j2000)).completed()
    linear = WCS(header, relax=False)
    linear.sip = None
    linear.wcs.ctype = ["RA---TAN", "DEC--TAN"]
    column, row = (axis.ravel() for axis in np.meshgrid(np.linspace(0, 1023, 9), np.linspace(0, 1023, 9)))
    ra, dec = np.radians(linear.all_pix2world(column, row, 1))
    sky = np.stack([np.cos(dec) * np.cos(ra), np.cos(dec) * np.sin(ra), np.sin(dec)], axis=-1)
    difference_px = camera.project(sky @ pose.camera_from_j2000.T) - np.stack([column, 1023 - row], axis=-1)
    print(f"\nlargest difference from the header's WCS: {np.abs(difference_px).max():.2e} px")
    assert np.abs(difference_px).max() < 1e-6
    assert np.allclose(np.array(camera.camera_from_instrument), CAMERA_FROM_NH_LORRI)

    spacecraft = pose.spacecraft_in_body_km
    sub_latitude = np.degrees(np.arcsin(spacecraft[2] / np.linalg.norm(spacecraft)))
    sub_longitude = np.degrees(np.arctan2(spacecraft[1], spacecraft[0])) % 360
    assert np.linalg.norm(spacecraft) == pytest.approx(header["SPCTRANG"], rel=1e-9)
    assert sub_latitude == pytest.approx(header["SPCTSCLA"], abs=1e-4)
    assert sub_longitude == pytest.approx(header["SPCTSCLO"], abs=1e-4)
    north = pose.camera_from_body[:, 2]
    assert np.degrees(np.arctan2(north[0], -north[1])) % 360 == pytest.approx(header["SPCTNAZ"], abs=1e-4)


def test_lorri_vectors_are_those_of_its_pds_label(data_folder: Path) -> None:
    """The PDS label states LT+S for both; SC_TARGET_POSITION_VECTOR and TARGET_SUN_POSITION_VECTOR are copied here."""
    pose = read_frame(data_folder / "images" / LORRI).label_pose
    assert pose.target_from_spacecraft_km == pytest.approx([-5897.4370, -539821.59, -133679.90], abs=0.01)
    assert pose.sun_from_target_km == pytest.approx([-1196904607.0918, 4444001487.7252, 1747594677.5422], abs=1)
    assert pose.body_from_j2000 is None


def test_europa_label_geometry_agrees_with_the_labels_own_angles(data_folder: Path) -> None:
    frame = read_frame(data_folder / "images/galileo/C0552809300R.IMG")
    camera, target = find_camera("galileo-ssi"), known_targets()["europa"]
    pose = pose_from_label_geometry(frame.label_geometry or {}, camera, target, frame.et or 0.0).completed()
    centre = camera.project(pose.target_in_camera_km)

    def azimuth(body_vector: np.ndarray) -> float:
        dx, dy = camera.project(pose.target_in_camera_km + pose.camera_from_body @ body_vector) - centre
        return float(np.degrees(np.arctan2(dy, dx)) % 360)

    north, sun = azimuth(np.array([0, 0, 1560.0])), azimuth(1560 * pose.sun_direction_in_body)
    boresight = pose.camera_from_j2000[2]
    ra, dec = np.degrees(np.arctan2(boresight[1], boresight[0])) % 360, np.degrees(np.arcsin(boresight[2]))
    print(f"\nnorth {north:.3f}, sun {sun:.3f}, phase {pose.phase_deg:.4f}, boresight {ra:.4f} {dec:.4f} deg")
    assert centre == pytest.approx([211.914, 110.785], abs=1e-6)
    assert north == pytest.approx(267.076, abs=1e-3)
    assert sun == pytest.approx(180.860, abs=0.05)  # an independent keyword: it fixes the sign of longitude
    assert pose.phase_deg == pytest.approx(63.707, abs=0.005)
    assert (ra, dec) == pytest.approx((114.967, 23.9387), abs=5e-4)  # and this one the whole chain to J2000
    lit = frame.observation.image[60:160, 100:320]
    assert lit[:, :110].mean() > 1.3 * lit[:, 110:].mean()


def test_tables_beside_the_images_are_no_images(data_folder: Path) -> None:
    for name in ("C2069302_GEOMA.DAT", "C2069302_RESLOC.DAT"):
        with pytest.raises(RefusedError) as refusal:
            read_frame(data_folder / "images/voyager" / name)
        assert name in refusal.value.fault


def test_a_label_stands_for_the_image_beside_it(data_folder: Path) -> None:
    by_label, by_image = (
        read_frame(data_folder / f"images/voyager/C1124748_RAW.{suffix}") for suffix in ("LBL", "IMG")
    )
    assert (by_label.observation.image == by_image.observation.image).all()
    assert (by_label.camera, by_label.target, by_label.et) == (by_image.camera, by_image.target, by_image.et)


def test_a_planet_that_only_the_picture_number_names_is_said(data_folder: Path) -> None:
    frame = read_frame(data_folder / "images/voyager/f1636832.raw")
    assert any("jupiter" in warning and "--target" in warning for warning in frame.warnings)


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(name=st.sampled_from(sorted(FRAMES)), data=st.data())
def test_real_files_with_damaged_heads_are_read_or_refused(
    data_folder: Path, tmp_path: Path, name: str, data: st.DataObject
) -> None:
    content = bytearray((data_folder / "images" / name).read_bytes())
    if data.draw(st.booleans()):
        content = content[: data.draw(st.integers(0, len(content) - 1))]
    for place in data.draw(st.lists(st.integers(0, 4000), max_size=6)):
        if place < len(content):
            content[place] = data.draw(st.integers(0, 255))
    path = tmp_path / Path(name).name
    path.write_bytes(content)
    fault = ""
    try:
        assert read_frame(path).observation.image.size
    except RefusedError as refusal:
        fault = refusal.fault
    assert not fault or str(path) in fault
