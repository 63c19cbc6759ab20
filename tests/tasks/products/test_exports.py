"""Exports: other people's tools open them without a warning and find in them what the cube says."""

import dataclasses
import json
import warnings

import numpy as np
import pandas as pd
import pystac
import pytest
import rasterio
import xarray as xr
from astropy.io import fits
from astropy.wcs import WCS
from pyproj import CRS
from small_product import small_publication, write_cube

from catalog.errors import RefusedError
from catalog.observation import Quality
from catalog.readers import read_frame
from catalog.rotation import rotation_from_vector_deg
from tasks.export.fits import write_backplanes
from tasks.export.map_image import LAYERS
from tasks.export.pixels import Selection, pixel_table
from tasks.export.products import export_products
from tasks.export.settings import FORMATS, ExportSettings
from tasks.export.source import read_source
from tasks.export.stac import target_class
from tasks.publish import publish
from tasks.publish.cube import cube_dataset
from tasks.publish.extra_planes import write_extra_planes

SETTINGS = ExportSettings(FORMATS, "orthographic")


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    store = tmp_path_factory.mktemp("store")
    publish(small_publication("C0001"), store)
    write_extra_planes(store / "C0001", ("right_ascension", "shadow"))
    write_cube(cube_dataset(small_publication("C0002", provenance={})), store / "C0002" / "cube.zarr")
    (store / "C0003").mkdir()
    return store


@pytest.fixture(scope="module")
def exported(store, tmp_path_factory):
    folders = [store / name for name in ("C0001", "C0002", "C0003")]
    out = tmp_path_factory.mktemp("out")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        results = export_products(folders, SETTINGS, out)
    assert not [path for path in out.rglob("*") if path.name.endswith(".tmp")]
    return results


@pytest.fixture(scope="module")
def files(exported):
    return exported[0].files


@pytest.fixture(autouse=True)
def warnings_are_errors():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        yield


def test_every_format_is_written_and_a_bad_product_does_not_stop_the_others(exported):
    assert [bool(result.reason) for result in exported] == [False, False, True]
    assert set(exported[0].files) == set(FORMATS)
    assert all(path.exists() for result in exported[:2] for path in result.files.values())
    assert "holds no cube.zarr" in exported[2].reason
    assert exported[2].to_dict()["status"] == "refused"


def test_gdal_and_pvl_read_the_isis_cube(store, files):
    source = read_source(store / "C0001")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # pvl warns of its own deprecated class
        import pvl

        label = pvl.load(str(files["isis-cube"]))
    assert list(label["IsisCube"]["BandBin"]["Name"])[:2] == ["Image", "Phase Angle"]
    assert label["IsisCube"]["Instrument"]["TargetName"] == "europa"
    again = read_frame(files["isis-cube"], plane="Image")
    assert (again.target, again.sources["time"]) == ("europa", "IMAGE_MID_TIME")
    assert again.et == pytest.approx(source.pose.et, abs=2e-3)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
        with rasterio.open(files["isis-cube"]) as cube:
            assert cube.driver == "ISIS3"
            bands = cube.read(masked=True)
    for number, (plane, factor) in {0: ("image", 1), 4: ("latitude", 1), 6: ("resolution_km", 1000)}.items():
        ours = source.cube[plane].values
        assert np.array_equal(bands[number].mask, ~np.isfinite(ours))
        assert bands[number].compressed() == pytest.approx(ours[np.isfinite(ours)] * factor, rel=1e-6)


def test_the_isd_is_the_products_pose_and_camera(store, files):
    from catalog.camera import Camera
    from catalog.isd import pose_from_isd

    source = read_source(store / "C0001")
    for path in (files["isd"], files["isd"].with_name("C0001_isd_detector.json")):
        pose, camera = pose_from_isd(path).completed(), Camera.from_isd(path)
        np.testing.assert_allclose(pose.camera_from_j2000, source.pose.camera_from_j2000, atol=1e-12)
        np.testing.assert_allclose(pose.body_from_j2000, source.pose.body_from_j2000, atol=1e-12)
        np.testing.assert_allclose(pose.target_from_spacecraft_km, source.pose.target_from_spacecraft_km)
        pixels = np.array([[3.0, 5.0], [150.0, 20.0]])
        np.testing.assert_allclose(camera.detector_ray(pixels), source.camera.ray(pixels), atol=1e-12)


def test_astropy_finds_the_planes_and_the_sky(store, files):
    source = read_source(store / "C0001")
    with fits.open(files["fits"], checksum=True) as hdus:
        hdus.verify("exception")
        header = hdus[0].header
        assert np.array_equal(hdus[0].data, source.cube["image"].values)
        for name in ("latitude", "longitude", "incidence", "emission", "phase", "range_km", "quality"):
            assert np.array_equal(hdus[name].data, source.cube[name].values, equal_nan=name != "quality"), name
        assert np.isfinite(hdus["RIGHT_ASCENSION"].data).all()
        assert hdus["RIGHT_ASCENSION"].header["BUNIT"] == "deg"
        assert set(np.unique(hdus["SHADOW"].data[np.isfinite(hdus["SHADOW"].data)])) == {0.0, 1.0}
        assert hdus["INCIDENCE"].header["BUNIT"] == "deg"
        assert hdus["QUALITY"].data.dtype == np.uint16
        assert header["OBJECT"] == "europa"
        assert header["LONDIR"] == "east"
        history = "".join(str(header["HISTORY"]).split())
        assert "pose_after.camera_from_j2000=1,0,0,0,1,0,0,0,1" in history
        assert header["DATE-OBS"] == source.attributes["utc"].removesuffix("Z")


def test_the_sky_of_a_fits_file_is_that_of_the_pose(store, tmp_path):
    source = read_source(store / "C0001")
    turned = source.pose.replaced(camera_from_j2000=rotation_from_vector_deg([50.0, -70.0, 20.0]))
    source = dataclasses.replace(source, pose=turned)
    header = fits.getheader(write_backplanes(source, tmp_path / "turned.fits"))
    xy = np.array([[10.0, 140.0], [79.5, 79.5], [150.0, 3.0]])
    right_ascension, declination = np.radians(WCS(header).all_pix2world(xy, 0)).T
    cosine = np.cos(declination)
    sky = np.stack([cosine * np.cos(right_ascension), cosine * np.sin(right_ascension), np.sin(declination)], axis=1)
    assert np.abs(sky - source.camera.ray(xy) @ turned.camera_from_j2000).max() < 1e-11


@pytest.mark.parametrize("kind", ["geotiff", "cog"])
def test_gdal_finds_named_bands_the_bodys_crs_and_nodata(files, kind):
    with rasterio.open(files[kind]) as file:
        assert file.descriptions == LAYERS
        assert np.isnan(file.nodata)
        crs = CRS.from_wkt(file.crs.to_wkt())
        assert crs.ellipsoid.semi_major_metre == 1560800
        assert crs.ellipsoid.inverse_flattening == 0
        assert "Europa (2015)" in file.crs.to_wkt()
        assert crs.coordinate_operation.method_name.startswith("Orthographic")
        assert file.tags()["product"] == "C0001"
        assert file.units[1] == "degree"
        layout = file.tags(ns="IMAGE_STRUCTURE").get("LAYOUT")
        assert layout == ("COG" if kind == "cog" else None)
        emission = file.read(3)
        row, column = file.index(0.0, 0.0)  # below the spacecraft
        assert emission[row, column] < 2
        assert np.nanmin(emission) >= 0
        assert np.nanmax(emission) <= 85


def test_zarr_maps_carry_cf_coordinates_wkt_and_geotransform_and_equal_the_geotiff(files):
    with xr.open_zarr(files["zarr-map"]) as mapped, rasterio.open(files["geotiff"]) as file:
        assert np.array_equal(mapped["image"].values, file.read(1), equal_nan=True)
        transform = [float(value) for value in mapped["spatial_ref"].attrs["GeoTransform"].split()]
        assert transform == list(file.transform.to_gdal())
        assert mapped["x"].values[0] == pytest.approx(file.xy(0, 0)[0])
        assert mapped["y"].values[0] == pytest.approx(file.xy(0, 0)[1])
        crs = CRS.from_wkt(mapped["spatial_ref"].attrs["crs_wkt"])
        assert crs.geodetic_crs.to_authority() == ("IAU_2015", "50200")
        assert mapped["incidence"].attrs["grid_mapping"] == "spatial_ref"
        assert mapped["x"].attrs["standard_name"] == "projection_x_coordinate"
        assert len([path for path in (files["zarr-map"] / "image" / "c").rglob("*") if path.is_file()]) == 1


def test_pystac_reads_a_valid_collection_whose_assets_exist(files, store):
    """The core schemas ship with pystac; those of the extensions are on the web, so their fields are looked at."""
    from pystac.stac_object import STACObjectType
    from pystac.validation import JsonSchemaSTACValidator

    collection = pystac.Collection.from_file(str(files["stac"].parent.parent / "collection.json"))
    validator = JsonSchemaSTACValidator()
    core = validator.validate_core(collection.to_dict(), STACObjectType.COLLECTION, pystac.get_stac_version())
    assert core
    items = {item.id: item for item in collection.get_items()}
    assert set(items) == {"C0001", "C0002"}
    for item in items.values():
        validator.validate_core(item.to_dict(), STACObjectType.ITEM, pystac.get_stac_version())
    item = items["C0001"]
    assert {"cube", "planes", "overlay", "result", "fits", "cog", "csv"} <= set(item.assets)
    for asset in item.assets.values():
        assert not asset.href.startswith("/")
        with open(asset.get_absolute_href() + ("/zarr.json" if ".zarr" in asset.href else ""), "rb") as file:
            assert file.read(1)
    properties = item.properties
    assert properties["ssys:targets"] == ["Europa"]
    assert properties["ssys:target_class"] == "satellite"
    assert properties["view:incidence_angle"] < 1.5  # the body's middle is in the frame
    assert properties["view:sun_elevation"] == pytest.approx(90 - read_source(store / "C0001").pose.phase_deg, abs=2)
    assert properties["proj:code"] is None
    assert "IAU" in properties["proj:wkt2"]
    assert item.assets["cog"].extra_fields["proj:shape"] == list(rasterio.open(files["cog"]).shape)
    assert len(item.bbox) == 4
    assert item.datetime.isoformat()[:19] == read_source(store / "C0001").attributes["utc"][:19]


def test_the_footprint_is_what_the_cube_sees(files, store):
    from rasterio.features import rasterize

    item = json.loads(files["stac"].read_text())
    transform = rasterio.Affine(1, 0, -180, 0, -1, 90)
    mask = rasterize([item["geometry"]], (180, 360), transform=transform)
    cube = read_source(store / "C0001").cube
    latitude, longitude = cube["latitude"].values, cube["longitude"].values
    seen = np.isfinite(latitude) & (cube["emission"].values < 80)
    row = np.floor(90 - latitude[seen]).astype(int)
    column = np.floor((longitude[seen] + 180) % 360).astype(int)
    assert mask[row, column].all()
    area = (mask * np.cos(np.radians(89.5 - np.arange(180)))[:, None]).sum() * (np.pi / 180) ** 2 / (4 * np.pi)
    assert area == pytest.approx((1 - np.cos(np.radians(85 - 0.2))) / 2, abs=0.005)  # 333 radii away


def test_tables_hold_the_usable_pixels_and_csv_says_the_same_as_parquet(files, store):
    source = read_source(store / "C0001")
    table, text = pd.read_parquet(files["parquet"]), pd.read_csv(files["csv"])
    assert list(table.columns) == list(text.columns)
    assert np.allclose(table["incidence"], text["incidence"], rtol=1e-6)
    quality = source.cube["quality"].values
    usable = (quality & (Quality.OFF_BODY | Quality.NIGHT_SIDE | Quality.LIMB)) == 0
    assert len(table) == usable.sum() > 1000
    row = table.iloc[123]
    for name in ("image", "latitude", "phase", "resolution_km"):
        assert row[name] == source.cube[name].values[row["y"], row["x"]]


def test_selections_run_through_the_meridian_and_refuse_nothing_silently(store, tmp_path):
    source = read_source(store / "C0001")
    whole = pixel_table(source)
    middle = float(whole["longitude"].median())
    west, east = (middle - 10) % 360, (middle + 10) % 360
    part = pixel_table(source, Selection(longitude_deg=(west, east), latitude_deg=(-30, 30), max_incidence_deg=60))
    assert 0 < len(part) < len(whole)
    assert (np.abs((part["longitude"] - middle + 180) % 360 - 180) <= 10.001).all()
    assert part["latitude"].abs().max() <= 30
    assert part["incidence"].max() <= 60
    rest = pixel_table(source, Selection(longitude_deg=(east, west)))
    assert len(rest) + len(pixel_table(source, Selection(longitude_deg=(west, east)))) == pytest.approx(
        len(whole), abs=2
    )
    assert len(pixel_table(source, Selection(every_flag=True))) > len(whole)
    nothing = ExportSettings(("csv",), selection=Selection(latitude_deg=(1.0, 1.0)))
    results = export_products([store / "C0001"] * 2, nothing, tmp_path)
    assert "no pixels" in results[0].reason
    assert "product-twice" in results[1].reason
    assert list(tmp_path.iterdir()) == []


def test_unknown_formats_are_refused_and_bodies_have_a_class():
    with pytest.raises(RefusedError, match="no format shapefile"):
        ExportSettings(("fits", "shapefile"))
    europa = small_publication().target
    classes = {599: "planet", 999: "dwarf_planet", 301: "satellite", 2000004: "asteroid", 1000012: "comet"}
    assert {n: target_class(europa.model_copy(update={"naif_id": n})) for n in classes} == classes
