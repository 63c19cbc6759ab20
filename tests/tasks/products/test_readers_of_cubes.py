"""Other people's tools on our cubes: over HTTP, by CF's rules, by the schema document."""

import threading
import warnings
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import cf_xarray  # noqa: F401 - gives datasets the accessor `cf`
import numpy as np
import pytest
import xarray as xr
from pyproj import CRS
from small_product import small_publication

from tasks.publish import publish
from tasks.publish.cube import open_cube
from tasks.publish.index import open_index
from tasks.publish.schema import schema_markdown
from tasks.publish.variables import VARIABLES

ROOT = Path(__file__).parents[3]


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    store = tmp_path_factory.mktemp("store")
    publish(small_publication("C0001"), store)
    open_index(store)
    return store


class Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass


@pytest.fixture
def served(store):
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=str(store)))
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    yield f"http://127.0.0.1:{server.server_port}"
    server.shutdown()
    thread.join()
    server.server_close()


def test_a_static_web_server_is_enough(store, served):
    import pandas as pd

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with xr.open_zarr(f"{served}/C0001/cube.zarr") as remote, open_cube(store / "C0001" / "cube.zarr") as local:
            assert remote["latitude"].chunks is not None
            crop = {"x": slice(70, 90), "y": slice(70, 90)}
            xr.testing.assert_equal(remote.isel(crop).load(), local.isel(crop).load())
    assert list(pd.read_parquet(f"{served}/index.parquet")["product"]) == ["C0001"]


def test_cf_tools_find_coordinates_angles_uncertainties_and_the_crs(store):
    with open_cube(store / "C0001" / "cube.zarr") as cube:
        assert cube.cf.coordinates == {"latitude": ["latitude"], "longitude": ["longitude"]}
        assert cube.cf["solar_zenith_angle"].name == "incidence"
        assert cube.cf["sensor_zenith_angle"].name == "emission"
        assert cube.cf.grid_mapping_names == {"latitude_longitude": ["crs"]}
        assert "latitude_uncertainty" in cube.cf["latitude"].attrs["ancillary_variables"]
        assert "quality" in cube.cf[["image"]].coords  # cf_xarray brings ancillary variables along
        for variable in VARIABLES:
            assert "grid_mapping" in cube[variable.name].attrs | cube[variable.name].encoding
        night = cube["quality"].cf == "night_side"
        assert np.array_equal(night.values, cube["incidence"].values >= 90)
        crs = CRS.from_wkt(cube["crs"].attrs["crs_wkt"])
        assert crs.to_authority() == ("IAU_2015", "50200")
        assert crs == CRS.from_cf(cube["crs"].attrs)


def test_the_schema_document_is_what_the_code_says():
    """When it fails: python -m tasks.publish.schema > docs/schema.md"""
    assert (ROOT / "docs" / "schema.md").read_text(encoding="utf-8") == schema_markdown()
