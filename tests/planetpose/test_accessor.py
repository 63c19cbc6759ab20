"""The xarray accessor of cubes."""

import sys
from pathlib import Path

import matplotlib
import numpy as np
import pyproj
import pytest
import xarray

sys.path.insert(0, str(Path(__file__).parents[1] / "tasks" / "products"))

from small_product import small_publication

import planetpose
from tasks.publish import publish
from tasks.publish.cube import cube_dataset

matplotlib.use("Agg")


@pytest.fixture(scope="module")
def cube(tmp_path_factory: pytest.TempPathFactory) -> xarray.Dataset:
    return planetpose.open_cube(publish(small_publication(), tmp_path_factory.mktemp("store")) / "cube.zarr")


def test_places_and_pixels_are_those_of_the_functions(cube: xarray.Dataset) -> None:
    latitude, longitude = cube.planetpose.place_of([70.0, 3.0], [95.0, 3.0])
    assert np.isnan(latitude[1])
    np.testing.assert_array_equal((latitude, longitude), planetpose.place_of(cube, [70.0, 3.0], [95.0, 3.0]))
    x, y = cube.planetpose.pixel_of(latitude, longitude)
    np.testing.assert_allclose((x[0], y[0]), (70.0, 95.0), atol=1e-6)
    assert [each.remark for each in cube.planetpose.at([70, 3], [95, 3])] == ["", "off the body"]
    assert cube.planetpose.at_place(latitude[0], longitude[0])[0].x_px == pytest.approx(70.0, abs=1e-6)


def test_the_whole_store_has_it_and_what_is_no_cube_is_refused(tmp_path: Path) -> None:
    publish(small_publication(), tmp_path)
    for node in planetpose.open_store(tmp_path).children.values():
        assert node.to_dataset().planetpose.model.target.name == "europa"
    with pytest.raises(planetpose.RefusedError, match="no cube of an image"):
        xarray.Dataset().planetpose.pixel_of(0, 0)


def test_the_parts_of_an_uncertainty_add_up(cube: xarray.Dataset) -> None:
    for name in ("latitude", "longitude_uncertainty"):
        parts = cube.planetpose.uncertainty_parts(name)
        assert set(parts.data_vars) == {"pose", "distortion", "map_frame"}
        known = [parts[part] for part in parts.data_vars if np.isfinite(parts[part]).any()]
        whole = cube[f"{name.removesuffix('_uncertainty')}_uncertainty"]
        inside = whole < 20  # nowhere cut
        np.testing.assert_allclose(sum(part**2 for part in known).where(inside), (whole**2).where(inside), rtol=4e-3)
    with pytest.raises(ValueError, match="neither"):
        cube.planetpose.uncertainty_parts("range")


def test_a_plane_is_drawn_with_its_curves(cube: xarray.Dataset) -> None:
    axes = cube.planetpose.plot()
    assert len(axes.images) == 1
    assert len(axes.lines) > 15
    assert len(cube.planetpose.plot("incidence", layers=("limb",)).lines) == 1
    with pytest.raises(planetpose.RefusedError, match="It has"):
        cube.planetpose.plot("incidense")
    with pytest.raises(ValueError, match="known are limb"):
        cube.planetpose.plot(layers=("stars",))


def test_a_map_shows_at_a_place_what_the_image_shows_there(cube: xarray.Dataset) -> None:
    mapped = cube.planetpose.to_map(max_emission_deg=60)
    assert {"image", "incidence", "emission", "phase"} <= set(mapped.data_vars)
    assert mapped.attrs["projection"] == "equirectangular"
    assert float(mapped.emission.max()) <= 60
    latitude, longitude = (float(v) for v in cube.planetpose.place_of(70.0, 95.0))
    crs = pyproj.CRS.from_cf(mapped.spatial_ref.attrs)
    x, y = pyproj.Transformer.from_crs(crs.geodetic_crs, crs, always_xy=True).transform(longitude, latitude)
    there = mapped.sel(x=x, y=y, method="nearest")
    assert float(there.incidence) == pytest.approx(float(cube.incidence.sel(x=70, y=95)), abs=2.0)


def test_images_can_be_grouped_by_a_plane(cube: xarray.Dataset) -> None:
    """The phase curve of the first afternoon; xarray does it lazily with flox, and says so where that is missing."""
    means = cube.image.groupby_bins(cube.incidence, np.arange(0, 91, 10)).mean()
    incidence, image = cube.incidence.values, cube.image.values
    wanted = [image[(incidence > low) & (incidence <= low + 10)].mean() for low in range(0, 90, 10)]
    np.testing.assert_allclose(means.values, wanted, rtol=1e-4)


def test_datasets_that_were_never_written_have_it_too() -> None:
    made = cube_dataset(small_publication())
    assert made.planetpose.place_of(3.0, 3.0)[0] != made.planetpose.place_of(80.0, 80.0)[0]
