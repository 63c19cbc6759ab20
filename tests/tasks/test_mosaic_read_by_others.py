"""What other people's libraries make of a mosaic: rio-cogeo and GDAL of the COG, pystac of the item, rioxarray,
cf_xarray and GDAL's Zarr driver of the group."""

import json

import cf_xarray  # noqa: F401
import numpy as np
import pystac
import pytest
import rasterio
import rioxarray  # noqa: F401
import xarray as xr
from pyproj import CRS
from rio_cogeo.cogeo import cog_info, cog_validate

from catalog.target import find_target
from lab.maps.albedo import blotches
from lab.simulate.albedo_store import paper_views, write_albedo_store
from tasks.export.cog import write_cog
from tasks.export.map_grid import body_crs
from tasks.mosaic.build import build_mosaic
from tasks.mosaic.outputs import write_forms
from tasks.mosaic.settings import MosaicSettings
from tasks.mosaic.variables import MAP

PRODUCTS = ("LOR_0034732619", "LOR_0034849319", "C1632318")
BODY = body_crs(find_target("europa"))
READS_ZARR_3 = tuple(int(part) for part in rasterio.__gdal_version__.split(".")[:2]) >= (3, 12)


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    folder = tmp_path_factory.mktemp("others") / "store"
    write_albedo_store(folder, paper_views(PRODUCTS), blotches(), noise=0.004, subpixels_across=200)
    return folder


@pytest.fixture(scope="module")
def files(store, tmp_path_factory):
    """The group, COG and item of a whole map of 3 pixels per degree."""
    group = tmp_path_factory.mktemp("forms") / "map.zarr"
    mosaic = build_mosaic(store, group, MosaicSettings(law="lunar-lambert", resolution="3ppd"))
    return group, *write_forms(mosaic, ("cog", "stac"))


def test_rio_cogeo_finds_no_fault_in_the_geotiff(files) -> None:
    valid, errors, warnings = cog_validate(files[1], strict=True)
    assert (valid, errors, warnings) == (True, [], [])
    levels = cog_info(files[1]).IFD
    assert [(level.Width, level.Height) for level in levels] == [(1080, 540), (540, 270), (270, 135), (135, 68)]
    assert {level.Blocksize for level in levels} == {(256, 256)}


def test_gdal_knows_bands_units_nodata_and_the_body(files) -> None:
    with rasterio.open(files[1]) as tiff, xr.open_zarr(files[0]) as group:
        assert tiff.tags(ns="IMAGE_STRUCTURE")["LAYOUT"] == "COG"
        assert list(tiff.descriptions) == [variable.name for variable in MAP]
        assert list(tiff.units) == [variable.units for variable in MAP]
        assert np.isnan(tiff.nodatavals).all()
        assert set(tiff.scales) == {1.0}
        assert set(tiff.offsets) == {0.0}
        crs = CRS.from_wkt(tiff.crs.to_wkt())
        assert crs.ellipsoid.semi_major_metre == BODY.ellipsoid.semi_major_metre == 1_560_800
        assert crs.geodetic_crs.name == BODY.name
        assert tiff.tags()["images"].split() == group.attrs["products"]
        # The corners of the map are where the coordinates of the group say.
        from rasterio.warp import transform

        place = transform(tiff.crs, tiff.crs.from_wkt(BODY.to_wkt()), *([v] for v in tiff.xy(10, 20)))
        assert place[0][0] % 360 == pytest.approx(float(group.lon[20]), abs=1e-9)
        assert place[1][0] == pytest.approx(float(group.lat[10]), abs=1e-9)


def test_overviews_of_an_index_are_whole_numbers_and_those_of_reflectance_means(files) -> None:
    with rasterio.open(files[1]) as tiff, rasterio.open(files[1], overview_level=0) as half:
        index = [variable.name for variable in MAP].index("image_index") + 1
        assert np.array_equal(half.read(index), tiff.read(index)[::2, ::2], equal_nan=True)
        whole = tiff.read(1)
        means = whole.reshape(whole.shape[0] // 2, 2, whole.shape[1] // 2, 2).mean(axis=(1, 3))
        known = np.isfinite(means)
        assert known.sum() > 1000
        assert half.read(1)[known] == pytest.approx(means[known], rel=1e-5)


def test_overviews_of_odd_sides_and_of_none_are_written(tmp_path) -> None:
    for rows, columns, levels in ((777, 531, 2), (100, 90, 0)):
        values = np.arange(rows * columns, dtype=np.float32).reshape(rows, columns) % 11
        profile = {"driver": "GTiff", "count": 2, "dtype": "float32", "height": rows, "width": columns}
        path = write_cog(tmp_path / "odd.tif", profile, lambda file, v=values: file.write(np.stack([v, v])), [2])
        assert cog_validate(path, strict=True)[:2] == (True, [])
        assert [file.name for file in tmp_path.iterdir()] == ["odd.tif"]
        for level in range(levels):
            with rasterio.open(path, overview_level=level) as overview:
                factor = 2 ** (level + 1)
                assert np.array_equal(overview.read(2), values[::factor, ::factor])


def test_pystac_finds_no_fault_in_the_item(files) -> None:
    """The core schemas ship with pystac; those of the extensions are on the web, so their fields are looked at."""
    from pystac.stac_object import STACObjectType
    from pystac.validation import JsonSchemaSTACValidator

    content = json.loads(files[2].read_text())
    JsonSchemaSTACValidator().validate_core(content, STACObjectType.ITEM, pystac.get_stac_version())
    item = pystac.Item.from_file(str(files[2]))
    with rasterio.open(item.assets["cog"].get_absolute_href()) as tiff:
        fields = item.assets["cog"].extra_fields
        assert fields["proj:shape"] == list(tiff.shape)
        assert fields["proj:transform"] == pytest.approx(list(tiff.transform)[:6])
        assert fields["proj:bbox"] == pytest.approx(list(tiff.bounds))
        assert [band["name"] for band in fields["bands"]] == list(tiff.descriptions)
    assert xr.open_zarr(item.assets["zarr"].get_absolute_href()).sizes["lon"] == 1080
    assert item.properties["start_datetime"] < item.properties["end_datetime"]


def test_the_outline_of_the_item_holds_what_the_map_shows(files) -> None:
    from rasterio.features import rasterize

    item = json.loads(files[2].read_text())
    west, south, east, north = item["bbox"]
    assert -180 <= west < east <= 180
    assert -90 <= south < north <= 90
    inside = rasterize([item["geometry"]], (180, 360), transform=rasterio.Affine(1, 0, -180, 0, -1, 90))
    with xr.open_zarr(files[0]) as group:
        row, column = np.nonzero(group["count"].values)
        latitude, longitude = group.lat.values[row], group.lon.values[column]
    cell = np.floor(90 - latitude).astype(int), np.floor((longitude + 180) % 360).astype(int)
    assert inside[cell].all()
    assert 0.3 < inside.mean() < 1


def test_rioxarray_finds_the_body_and_the_place_of_the_pixels(files) -> None:
    with xr.open_zarr(files[0]) as group:
        assert group.rio.crs.to_string() == "IAU_2015:50200"
        assert CRS.from_wkt(group.reflectance.rio.crs.to_wkt()).name == BODY.name
        assert group.reflectance.rio.bounds() == pytest.approx((0.0, -90.0, 360.0, 90.0))
        assert group.reflectance.rio.transform().to_gdal() == pytest.approx((0.0, 1 / 3, 0.0, 90.0, 0.0, -1 / 3))
        assert np.isnan(group.reflectance.rio.nodata)
        part = group.reflectance.rio.clip_box(200, -10, 220, 10)
        assert abs(part.lon.values - 210).max() < 10.4
        assert part.shape[0] in (60, 61)


def test_cf_xarray_finds_axes_coordinates_bounds_grid_mapping_and_names(files) -> None:
    with xr.open_zarr(files[0], decode_coords="all") as group:
        assert group.cf.coordinates["latitude"] == ["lat"]
        assert group.cf.coordinates["longitude"] == ["lon"]
        assert group.cf.axes["X"] == ["lon"]
        assert group.cf.grid_mapping_names["latitude_longitude"] == ["crs"]
        assert group.reflectance.cf["grid_mapping"].attrs["semi_major_axis"] == 1_560_800
        assert {"solar_zenith_angle", "sensor_zenith_angle", "number_of_observations"} <= set(group.cf.standard_names)
        for axis, width in (("latitude", -1 / 3), ("longitude", 1 / 3)):
            bounds, centres = group.cf.get_bounds(axis).values, group.cf[axis].values
            assert bounds.mean(axis=1) == pytest.approx(centres)
            assert np.diff(bounds, axis=1) == pytest.approx(width)
            assert np.array_equal(np.round(bounds[1:, 0], 9), np.round(bounds[:-1, 1], 9))
        named = group.reflectance.attrs["ancillary_variables"].split()
        assert set(named) <= set(group.variables)
        for name in ("lat", "lon", "lat_bnds", "lon_bnds", "crs"):
            assert "_FillValue" not in group[name].encoding, name


@pytest.mark.parametrize(("middle", "left"), [(0.0, -180.0), (300.0, -240.0), (90.0, -90.0)])
def test_longitudes_rise_whatever_the_middle(store, tmp_path, middle, left) -> None:
    settings = MosaicSettings(law="lunar-lambert", resolution="0.5ppd", central_longitude_deg=middle)
    build_mosaic(store, tmp_path / "map.zarr", settings)
    build_mosaic(store, tmp_path / "usual.zarr", MosaicSettings(law="lunar-lambert", resolution="0.5ppd"))
    with xr.open_zarr(tmp_path / "map.zarr") as group, xr.open_zarr(tmp_path / "usual.zarr") as usual:
        assert group.reflectance.rio.bounds() == pytest.approx((left, -90, left + 360, 90))
        assert np.all(np.diff(group.lon) > 0)
        turned = np.argsort(group.lon.values % 360)
        same = group.reflectance.values[:, turned], usual.reflectance.values
        assert np.array_equal(np.isfinite(same[0]), np.isfinite(same[1]))
        assert same[0][np.isfinite(same[0])] == pytest.approx(same[1][np.isfinite(same[1])], rel=2e-3)


def test_gdal_opens_a_layer_of_the_group(files) -> None:
    """GDAL before 3.12 reads no array of Zarr 3 as its standard is now, from any writer, and says so."""
    name = f'ZARR:"{files[0]}":/reflectance'
    if not READS_ZARR_3:
        with pytest.raises(rasterio.errors.RasterioIOError, match="codec"), rasterio.open(name):
            pass
        return
    with rasterio.open(name) as layer, xr.open_zarr(files[0]) as group:
        assert layer.bounds == pytest.approx((0.0, -90.0, 360.0, 90.0))
        assert CRS.from_wkt(layer.crs.to_wkt()).name == BODY.name
        assert np.array_equal(layer.read(1), group.reflectance.values, equal_nan=True)
