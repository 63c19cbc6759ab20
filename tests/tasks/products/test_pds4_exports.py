"""PDS4 exports: pds4_tools, GDAL and our own reader find in them what the cube says, and the labels follow the
schema's content models."""

import re
import warnings
from xml.etree import ElementTree

import numpy as np
import pytest
import rasterio
from pds4_model import PDS, faults_of
from small_product import EUROPA, pose_of, small_publication

from catalog.camera import find_camera
from catalog.readers import read_frame
from catalog.target import find_target
from tasks.export.map_grid import PROJECTIONS
from tasks.export.pds4 import bounding_degrees, target_type
from tasks.export.products import export_products
from tasks.export.settings import ExportSettings
from tasks.export.source import read_source
from tasks.export.write import mapped
from tasks.publish import publish
from tasks.publish.extra_planes import write_extra_planes

EXPOSURE_S = 0.4


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    store = tmp_path_factory.mktemp("store")
    provenance = {"image": {"sha256": "ab12", "exposure_s": EXPOSURE_S}}
    publish(small_publication("C0001", provenance=provenance), store)
    write_extra_planes(store / "C0001", ("right_ascension", "shadow"))
    publish(small_publication("Ünnamed-(odd)", provenance={}), store)
    return store


@pytest.fixture(scope="module")
def files(store, tmp_path_factory):
    out = tmp_path_factory.mktemp("out")
    found = {}
    for projection in PROJECTIONS:
        settings = ExportSettings(("pds4", "pds4-map", "fits"), projection)
        for done in export_products([store / "C0001", store / "Ünnamed-(odd)"], settings, out):
            assert done.reason is None
            found[done.product, projection] = done.files
    assert not [path for path in out.iterdir() if path.name.startswith(".") or path.is_dir()]
    return found


def labels_of(files):
    return sorted({path for each in files.values() for kind, path in each.items() if kind.startswith("pds4")})


def test_labels_follow_the_content_models(files):
    labels = labels_of(files)
    assert len(labels) == 2 + 2 * len(PROJECTIONS)
    for label in labels:
        root = ElementTree.parse(label).getroot()
        assert faults_of(root) == [], label.name
        identifier = root.findtext(f"{PDS}Identification_Area/{PDS}logical_identifier")
        assert re.fullmatch(r"urn:nasa:pds(:[a-z0-9._-]+){3}", identifier)
        names = {each.text for each in root.iter(f"{PDS}local_identifier_reference")}
        assert names <= {each.text for each in root.iter(f"{PDS}local_identifier")}
        file = label.with_name(root.findtext(f".//{PDS}file_name"))
        assert file.exists()
        size = root.findtext(f".//{PDS}file_size")
        assert size is None or int(size) == file.stat().st_size


def test_a_label_that_is_out_of_order_is_found():
    root = ElementTree.fromstring(f"<Time_Coordinates xmlns='{PDS[1:-1]}'><stop_date_time>a</stop_date_time>"
                                  "<start_date_time/></Time_Coordinates>")  # fmt: skip
    assert len(faults_of(root)) == 2


def test_pds4_tools_reads_every_plane(store, files):
    import pds4_tools

    source = read_source(store / "C0001")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of pds4_tools itself
        structures = pds4_tools.read(str(files["C0001", "orthographic"]["pds4"]), quiet=True)
        arrays = {each.id: np.asarray(each.data) for each in structures if each.is_array()}
    assert {"image", "latitude", "quality", "right_ascension", "shadow"} <= set(arrays)
    for name in ("image", "latitude", "incidence", "range_km", "quality"):
        assert np.array_equal(arrays[name], source.cube[name].values, equal_nan=name != "quality"), name


def test_gdal_reads_every_plane(store, files):
    source = read_source(store / "C0001")
    label = files["C0001", "orthographic"]["pds4"]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
        with rasterio.open(label) as first:
            assert (first.driver, first.nodata) == ("PDS4", None)
            places = first.subdatasets
        with rasterio.open(places[0]) as image:
            assert np.array_equal(image.read(1), source.cube["image"].values)
        seen = []
        for place in places:
            with rasterio.open(place) as plane:
                seen.append(plane.read(1))
    latitude = source.cube["latitude"].values
    assert any(np.array_equal(plane, latitude, equal_nan=True) for plane in seen)


@pytest.mark.parametrize("projection", PROJECTIONS)
def test_gdal_and_pds4_tools_read_the_maps(projection, store, files):
    import pds4_tools

    settings = ExportSettings(("pds4-map",), projection)
    expected = mapped(read_source(store / "C0001"), settings)
    label = files["C0001", projection]["pds4-map"]
    with rasterio.open(label) as map_file:
        assert map_file.driver == "PDS4"
        bands = map_file.read()
        crs, transform = map_file.crs, map_file.transform
    for band, values in zip(bands, expected.layers.values(), strict=True):
        assert np.array_equal(band, values, equal_nan=True)
    assert transform.almost_equals(expected.grid.transform, 1e-6)
    x, y = expected.grid.x_m()[[3, -4]], expected.grid.y_m()[[5, -6]]
    latitude, longitude = expected.grid.projection.latitude_longitude(x, y)
    from pyproj import CRS, Transformer

    body = CRS.from_wkt(crs.to_wkt())
    found = Transformer.from_crs(body, body.geodetic_crs, always_xy=True).transform(x, y)
    shown = np.isfinite(latitude)
    assert np.asarray(found[1])[shown] == pytest.approx(latitude[shown], abs=1e-9)
    assert np.asarray(found[0])[shown] % 360 == pytest.approx(longitude[shown], abs=1e-9)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        structure = pds4_tools.read(str(label), quiet=True)["image"]
        assert np.array_equal(np.asarray(structure.data), bands, equal_nan=True)


@pytest.mark.parametrize("prime_deg", [20.0, 250.0])
def test_limits_of_a_map_are_those_of_what_it_shows(prime_deg, store, tmp_path):
    settings = ExportSettings(("pds4-map",), "equirectangular")
    south_pole_seen = bounding_degrees(mapped(read_source(store / "C0001"), settings))
    assert (south_pole_seen[0], south_pole_seen[2]) == (0.0, 360.0)
    assert -90 <= south_pole_seen[1] < -85
    publish(small_publication("C0004", pose_after=pose_of(60.0, (90.0, prime_deg))), tmp_path)
    source = read_source(tmp_path / "C0004")
    west, south, east, north = bounding_degrees(mapped(source, settings))
    assert north == pytest.approx(-south, abs=3)
    below = np.degrees(np.arctan2(*source.pose.spacecraft_in_body_km[1::-1])) % 360
    assert (west + east) / 2 % 360 == pytest.approx(below, abs=3)
    assert 150 < east - west < 180


def test_our_own_reader_knows_the_file_again(store, files):
    source = read_source(store / "C0001")
    frame = read_frame(files["C0001", "orthographic"]["pds4"], plane="1")
    assert frame.target == "europa"
    assert frame.et == pytest.approx(source.pose.et, abs=2e-3)
    assert np.array_equal(frame.observation.image, source.cube["image"].values)


def test_begin_and_end_are_those_of_the_exposure(files):
    root = ElementTree.parse(files["C0001", "orthographic"]["pds4"]).getroot()
    begin, end = (root.findtext(f".//{PDS}{name}")[-7:-1] for name in ("start_date_time", "stop_date_time"))
    assert (float(end) - float(begin)) % 60 == pytest.approx(EXPOSURE_S, abs=2e-3)


def test_kinds_of_bodies_are_the_models_words():
    kinds = [target_type(find_target(name)) for name in ("europa", "saturn", "eros", "pluto", "ceres")]
    assert kinds == ["Satellite", "Planet", "Asteroid", "Dwarf Planet", "Asteroid"]
    assert target_type(EUROPA) == "Satellite"


def test_a_camera_of_the_catalog_has_the_names_of_labels(tmp_path):
    camera = find_camera("galileo-ssi").model_copy(update={"size_px": (160, 160), "centre_px": (79.5, 79.5)})
    publish(small_publication("C0003", camera=camera), tmp_path)
    done = export_products([tmp_path / "C0003"], ExportSettings(("pds4",)), tmp_path / "out")[0]
    root = ElementTree.parse(done.files["pds4"]).getroot()
    host, instrument = (each.findtext(f"{PDS}name") for each in root.iter(f"{PDS}Observing_System_Component"))
    assert f"{host}/{instrument}" in camera.label_names
