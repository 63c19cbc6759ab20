"""The catalog's targets: names, and rotation models that reproduce SPICE's."""

import json
from pathlib import Path

import numpy as np
import pytest
from astropy.io import fits

from catalog.basemap import packaged_map_path
from catalog.camera import find_camera
from catalog.errors import RefusedError
from catalog.lists import load_image_list
from catalog.lists.adding import check_list
from catalog.readers import read_frame
from catalog.target import Target, find_target, further_targets, known_targets
from flows.inputs import image_inputs
from flows.options import ReprocessOptions
from flows.request import Request, target_inputs
from flows.requests import request_of
from tasks.ingest import pose_step
from tasks.profile import find_profile
from tasks.work import Work

SECONDS_PER_YEAR = 365.25 * 86400.0
MEASURED_SINCE_PCK00010 = {"pluto", "charon"}

real = pytest.mark.real


def test_the_papers_moons_enceladus_and_pluto_are_in_the_catalog_with_their_maps() -> None:
    for name in ("io", "europa", "ganymede", "callisto", "enceladus", "pluto"):
        assert find_target(name).basemap


@pytest.mark.parametrize("spelling", ["Europa", " EUROPA ", "502"])
def test_a_target_is_found_by_any_spelling(spelling: str) -> None:
    assert find_target(spelling).name == "europa"


@pytest.mark.parametrize("name", sorted(known_targets()))
def test_target_crs_is_known_to_pyproj_and_belongs_to_the_body(name: str) -> None:
    import pyproj

    target = known_targets()[name]
    assert target.iau_crs is not None
    assert pyproj.CRS(target.iau_crs).name.lower().startswith(name)


def test_an_unknown_target_is_refused_with_what_is_known() -> None:
    with pytest.raises(RefusedError, match=r"'vulcan'.*callisto.*no PCK is loaded"):
        find_target("vulcan")


@real
@pytest.mark.parametrize("name", sorted(known_targets()))
def test_rotation_model_equals_spice_over_a_century(name: str, data_folder: Path) -> None:
    import spiceypy

    from catalog.spice import kernel_pool

    target = known_targets()[name]
    assert target.rotation is not None
    times = np.random.default_rng(target.naif_id).uniform(-50, 50, 20) * SECONDS_PER_YEAR
    with kernel_pool([data_folder / "kernels" / "pck"]):
        spice = [spiceypy.pxform("J2000", target.body_frame, et) for et in times]
        radii = spiceypy.bodvcd(target.naif_id, "RADII", 3)[1]
    ours = [target.rotation.body_from_j2000(et) for et in times]
    np.testing.assert_allclose(ours, spice, atol=1e-10)
    np.testing.assert_allclose(target.radii_km, radii, rtol=0.006 if name in MEASURED_SINCE_PCK00010 else 1e-12)


@real
def test_a_body_outside_the_catalog_comes_from_the_loaded_pck(data_folder: Path) -> None:
    import spiceypy

    from catalog.spice import kernel_pool

    pck = data_folder / "kernels" / "pck"
    amalthea = find_target("Amalthea", [pck])
    assert amalthea.naif_id == 505
    assert amalthea.radii_km == (125.0, 73.0, 64.0)
    assert amalthea.rotation is not None
    with kernel_pool([pck]):
        spice = spiceypy.pxform("J2000", amalthea.body_frame, 1e8)
    np.testing.assert_allclose(amalthea.rotation.body_from_j2000(1e8), spice, atol=1e-10)


@real
def test_a_name_that_no_pck_knows_is_refused_with_the_nearest_of_its_bodies(data_folder: Path) -> None:
    with pytest.raises(RefusedError, match=r"'amaltea'.*Did you mean amalthea"):
        find_target("amaltea", [data_folder / "kernels"])


@pytest.mark.parametrize(
    ("spelling", "naif_id"),
    [
        ("Miranda", 705), ("HYPERION", 607), ("phoebe", 609), ("433 Eros", 2000433), ("EROS", 2000433),
        ("101955 BENNU", 2101955), ("25143 itokawa", 2025143), ("Ryugu", 2162173), ("4 VESTA", 2000004),
        ("1 ceres", 2000001), ("Phobos", 401), ("616", 616), ("proteus", 808), ("21 Lutetia", 2000021),
    ],
)  # fmt: skip
def test_moons_and_small_bodies_are_found_by_name_number_and_id(spelling: str, naif_id: int) -> None:
    from catalog.readers.names import target_of_label

    assert find_target(spelling).naif_id == naif_id
    assert target_of_label(spelling) == find_target(spelling).name
    assert find_target(spelling).basemap is None


@real
def test_the_rotation_models_of_moons_and_small_bodies_equal_spice(data_folder: Path) -> None:
    import spiceypy

    from catalog.spice import kernel_pool

    compared = 0
    with kernel_pool([data_folder / "kernels" / "pck"]):
        for name, target in further_targets().items():
            if not spiceypy.bodfnd(target.naif_id, "RADII"):
                assert name in ("bennu", "ryugu")
                continue
            assert target.radii_km == tuple(spiceypy.bodvcd(target.naif_id, "RADII", 3)[1])
            if target.rotation is None or not target.body_frame:
                continue
            for et in np.random.default_rng(target.naif_id).uniform(-30, 30, 4) * SECONDS_PER_YEAR:
                spice = spiceypy.pxform("J2000", target.body_frame, et)
                np.testing.assert_allclose(target.rotation.body_from_j2000(et), spice, atol=1e-9, err_msg=name)
            compared += 1
    assert compared > 40


def test_the_catalogs_targets_with_maps_come_first() -> None:
    assert not set(known_targets()) & set(further_targets())
    assert len(known_targets()) + len(further_targets()) > 85


OWN_BODY = """
name = "{name}"
naif_id = {naif_id}
radii_km = [{radius}, {radius}, {radius}]
body_frame = ""
[rotation]
pole_ra_deg = [268.0]
pole_dec_deg = [64.0]
prime_meridian_deg = [36.0, 101.0]
"""


def own_body(path: Path, name: str = "Vulcan", naif_id: int = 199999, radius: float = 42.0) -> str:
    path.write_text(OWN_BODY.format(name=name, naif_id=naif_id, radius=radius))
    return str(path)


def test_a_file_is_a_new_target_and_the_label_s_own_geometry_is_dropped(tmp_path: Path) -> None:
    file = own_body(tmp_path / "vulcan.toml")
    assert find_target(file).radii_km == (42.0, 42.0, 42.0)
    image = np.random.default_rng(0).normal(20, 5, (20, 30)).astype(np.float32)
    fits.writeto(tmp_path / "a.fits", image, fits.Header({"TARGET": "Europa"}))
    frame = read_frame(tmp_path / "a.fits", target=file)
    assert frame.target == "vulcan"
    assert frame.overruled == ("the label says target europa, --target vulcan is used",)


def test_a_file_with_the_name_of_a_known_body_takes_its_place(tmp_path: Path) -> None:
    file = own_body(tmp_path / "mine.toml", "europa", 502, 1500.0)
    assert find_target(file).mean_radius_km == pytest.approx(1500)
    assert find_target("europa").mean_radius_km > 1550
    image = np.random.default_rng(0).normal(20, 5, (20, 30)).astype(np.float32)
    fits.writeto(tmp_path / "a.fits", image, fits.Header({"TARGET": "Europa"}))
    assert read_frame(tmp_path / "a.fits", target=file).overruled == ()


def test_map_and_shape_may_lie_beside_the_file(tmp_path: Path) -> None:
    file = tmp_path / "v.toml"
    own_body(file)
    (tmp_path / "grey.png").write_bytes(b"any")
    (tmp_path / "v.obj").write_text("v 0 0 0\n")
    file.write_text('basemap = "grey.png"\nshape = "v.obj"\n' + file.read_text())
    target = find_target(str(file))
    assert target.basemap is not None
    assert packaged_map_path(target.basemap) == tmp_path / "grey.png"
    assert (target.shape, len(target.shape_sha256 or "")) == (str(tmp_path / "v.obj"), 64)


@pytest.mark.parametrize(
    ("content", "reported"),
    [
        ("name = 'v'", "naif_id: Field required"),
        ("name = 'v'\nnaif_id = 1\nradii_km = [1, 0, 1]", "radii_km.1"),
        ("name = 'v'\nnaif_id = 1\nradii_km = [1, 1]", "radii_km"),
        ("name = ''\nnaif_id = 1\nradii_km = [1, 1, 1]", "name"),
        ("name = 'v'\nnaif_id = 1\nradii_km = [1, 1, 1]\nradius = 4", "radius: Extra"),
        ("name = 'v'\nnaif_id = 1\nradii_km = [1, 1, 1]\nshape = 'gone.obj'", "gone.obj"),
        (None, "No such file"),
    ],
)
def test_a_target_file_that_is_none_is_refused_by_name_and_field(
    content: str | None, reported: str, tmp_path: Path
) -> None:
    if content is not None:
        (tmp_path / "v.toml").write_text(content)
    with pytest.raises(RefusedError, match=r"v\.toml|gone\.obj") as refusal:
        find_target(str(tmp_path / "v.toml"))
    assert reported in refusal.value.fault
    assert refusal.value.remedy


def test_the_content_of_a_target_file_is_part_of_the_keys_and_its_place_is_not(tmp_path: Path) -> None:
    image = tmp_path / "a.fits"
    fits.writeto(image, np.zeros((3, 3), np.float32))

    def keyed(radius: float, name: str) -> object:
        request = Request(image=image, target=own_body(tmp_path / name, radius=radius), kernels=())
        assert target_inputs(request) == find_target(str(tmp_path / name))
        return image_inputs(request).model_dump(mode="json")

    assert keyed(42.0, "a.toml") == keyed(42.0, "b.toml") != keyed(43.0, "a.toml")
    assert target_inputs(Request(image=image, target="europa")) == "europa"
    assert target_inputs(Request(image=image)) is None


def test_the_step_takes_the_file_s_target_whole(tmp_path: Path) -> None:
    image = np.random.default_rng(0).normal(20, 5, (800, 800)).astype(np.float32)
    fits.writeto(tmp_path / "a.fits", image, fits.Header({"CAMERA": "galileo-ssi", "TARGET": "Europa"}))
    pose = {
        "et": 2e8, "camera_from_j2000": np.eye(3).tolist(), "target_from_spacecraft_km": [0, 0, 1e6],
        "sun_from_target_km": [1e8, 0, 0],
    }  # fmt: skip
    (tmp_path / "pose.json").write_text(json.dumps(pose))
    request = Request(image=tmp_path / "a.fits", target=own_body(tmp_path / "v.toml"))
    inputs = pose_step.PoseInputs(
        image=image_inputs(request), camera=find_camera("galileo-ssi"), frame="", pose_file="", kernels=()
    )
    files = pose_step.PoseFiles(request.image, None, tmp_path / "pose.json", ())
    done = pose_step.run(inputs, files, Work(tmp_path, lambda *_: None))
    assert (done.target.name, done.target.radii_km) == ("Vulcan", (42.0, 42.0, 42.0))
    assert done.sources["body_from_j2000"] == "catalog"


def test_a_list_names_target_files_relative_to_itself(tmp_path: Path) -> None:
    own_body(tmp_path / "v.toml")
    (tmp_path / "list.csv").write_text("image,target\na.fits,v.toml\nb.fits,gone.toml\n")
    for name, value in (("a", 1.0), ("b", 2.0)):
        fits.writeto(tmp_path / f"{name}.fits", np.full((3, 3), value, np.float32))
    listed = load_image_list(tmp_path / "list.csv")
    settings = ReprocessOptions(images=str(tmp_path / "list.csv"), store=str(tmp_path / "out"))
    requested = request_of(listed, listed.entries[0], settings, find_profile("joint"))
    assert requested.target == str(tmp_path / "v.toml")
    assert [fault for fault in check_list(tmp_path / "list.csv").faults if "gone.toml" in fault]


@pytest.mark.parametrize(
    ("radius_km", "stated_km", "relief_km"),
    [
        (10.0, None, 0.35),
        (150.0, None, 5.25),
        (250.0, None, 1.4),
        (900.0, None, 1.4),
        (1800.0, None, 0.0),
        (10.0, 0.1, 0.1),
    ],
)
def test_relief_is_as_reported_or_that_of_bodies_of_its_size(
    radius_km: float, stated_km: float | None, relief_km: float
) -> None:
    body = Target(name="body", naif_id=1, radii_km=(radius_km,) * 3, relief_km=stated_km)
    assert body.expected_relief_km == pytest.approx(relief_km)


def test_a_shape_model_has_its_relief_in_it() -> None:
    assert Target(name="body", naif_id=1, radii_km=(10.0,) * 3, shape="body.obj").expected_relief_km == 0


PCK_OF_DEGREE = """KPL/PCK
\\begindata
BODY{system}_NUT_PREC_ANGLES = ( {angles} )
{degree}
BODY{body}_RADII = ( 13.0 11.4 9.1 )
BODY{body}_POLE_RA = ( 317.67 -0.1084 0.0 )
BODY{body}_POLE_DEC = ( 52.88 -0.0613 0.0 )
BODY{body}_PM = ( 35.18 1128.84475928 0.0 )
BODY{body}_NUT_PREC_RA = ( 1.78 1.2 )
BODY{body}_NUT_PREC_DEC = ( -1.08 0.4 )
BODY{body}_NUT_PREC_PM = ( -1.42 0.3 )
\\begintext
"""


@pytest.mark.parametrize(
    ("body", "system", "angles", "degree"),
    [
        (401, 4, "190.7 19139.3 21.4 38280.6", ""),
        (401, 4, "190.7 19139.3 0.01 21.4 38280.6 -5.0", "BODY4_MAX_PHASE_DEGREE = 2"),
        (65040, 6, "190.7 19139.3 21.4 38280.6", ""),
    ],
)
def test_nutation_angles_of_a_pck_are_paired_as_spice_pairs_them(
    body: int, system: int, angles: str, degree: str, tmp_path: Path
) -> None:
    """pck00011 has quadratic angles for Mars and its moons (BODY4_MAX_PHASE_DEGREE); 65040 is a moon too."""
    import spiceypy

    from catalog.pck import target_from_pck
    from catalog.spice import kernel_pool

    names = f"\\begindata\nNAIF_BODY_NAME += ( 'TEST_MOON' )\nNAIF_BODY_CODE += ( {body} )\n\\begintext\n"
    pck = tmp_path / "test.tpc"
    pck.write_text(PCK_OF_DEGREE.format(body=body, system=system, angles=angles, degree=degree) + names)
    rotation = target_from_pck("TEST_MOON", [pck]).rotation
    assert rotation is not None
    with kernel_pool([pck]):
        for et in (0.0, 7.5e8, -6.0e8):
            assert rotation.body_from_j2000(et) == pytest.approx(spiceypy.tipbod("J2000", body, et), abs=1e-10)
