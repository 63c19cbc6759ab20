"""Mosaics: planted albedo comes back from images of a foreign photometric law, with errors that are what they say."""

import json
import shutil

import numpy as np
import pytest
import xarray as xr
from typer.testing import CliRunner

from catalog.errors import RefusedError, WrongOptionError
from catalog.target import find_target
from flows.cli import build_app
from lab.maps.albedo import blotches, mosaic_figures
from lab.simulate.albedo_store import paper_views, write_albedo_store
from tasks.mosaic.build import build_mosaic
from tasks.mosaic.grid import block_side, blocks_per_file, mosaic_grid
from tasks.mosaic.outputs import write_forms
from tasks.mosaic.settings import MosaicSettings, pixel_size_km
from tasks.mosaic.view import load_view

# Small disks of three cameras, from several sides.
VIEWS = (
    "LOR_0034732619",
    "LOR_0034849319",
    "LOR_0035025959",
    "C1630453",
    "C1632318",
    "C2053031",
    "C2056420",
    "C2058607",
)
LIMITS = {"max_incidence_deg": 70.0, "max_emission_deg": 70.0}
COARSE = {"resolution": "1ppd", "calibration_sigma": 0.05, "units_per_if": 3000.0, **LIMITS}


ALBEDO = blotches()


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    folder = tmp_path_factory.mktemp("albedo") / "store"
    chosen = [view for view in paper_views() if view.product in VIEWS]
    assert len(chosen) == len(VIEWS)
    return folder, write_albedo_store(folder, chosen, ALBEDO, noise=0.004, subpixels_across=400)


@pytest.fixture(scope="module")
def mosaic(store, tmp_path_factory):
    path = tmp_path_factory.mktemp("mosaic") / "map.zarr"
    settings = MosaicSettings(resolution="2ppd", calibration_sigma=0.05, units_per_if=3000.0, **LIMITS)
    made = build_mosaic(store[0], path, settings)
    with xr.open_zarr(path) as dataset:
        return made, dataset.load()


def test_the_planted_albedo_comes_back_without_seams(store, mosaic) -> None:
    made, dataset = mosaic
    found = mosaic_figures(dataset, ALBEDO, store[1])
    print(f"\n{found}; {made.models['all'].values}")
    assert found["shown"] > 0.5
    assert abs(found["gain"] - 1) < 0.05
    assert found["rms"] < 0.02
    assert 0.5 < found["within_1"] < 0.9
    assert found["seam"] < 0.005


def test_levels_are_those_that_were_planted(store, mosaic) -> None:
    made, _ = mosaic
    planted = np.array([store[1].factors[member.product] for member in made.members])
    found = np.log(made.models["all"].levels / planted)
    assert np.std(found) < 0.02 < np.std(np.log(planted))


def test_layers_coordinates_and_attributes_are_as_documented(mosaic) -> None:
    made, dataset = mosaic
    assert dataset.reflectance.dims == ("lat", "lon")
    assert dataset.lat.values[0] == pytest.approx(89.75)
    assert dataset.lon.values[0] == pytest.approx(0.25)
    assert np.all(np.diff(dataset.lon.values) > 0)
    for name in ("reflectance", "sigma", "phase", "incidence", "emission", "resolution_km"):
        assert dataset[name].dtype == np.float32
        assert dataset[name].attrs["grid_mapping"] == "crs"
    assert dataset["count"].dtype.kind == dataset.image_index.dtype.kind == "i"
    shown = np.isfinite(dataset.reflectance.values)
    assert np.array_equal(shown, dataset["count"].values > 0)
    assert np.array_equal(shown, dataset.image_index.values >= 0)
    assert dataset["count"].values.max() <= len(made.members) == len(dataset.attrs["products"])
    assert float(dataset.incidence.max()) <= 70
    assert float(dataset.emission.max()) <= 70
    parts = [dataset[f"sigma_{name}"].values[shown] ** 2 for name in ("noise", "pose", "photometry")]
    assert np.sqrt(sum(parts)) == pytest.approx(dataset.sigma.values[shown], rel=1e-3)
    assert dataset.crs.attrs["grid_mapping_name"] == "latitude_longitude"
    assert [float(x) for x in dataset.crs.attrs["GeoTransform"].split()] == pytest.approx([0, 0.5, 0, 90, 0, -0.5])
    assert json.loads(dataset.attrs["laws"])["all"]["parameters"]["w"] == made.models["all"].values["w"]


def test_small_blocks_several_to_a_file_give_the_same_map(store, mosaic, tmp_path, monkeypatch) -> None:
    monkeypatch.setattr("tasks.mosaic.grid.MOST_FILES", 4)
    settings = MosaicSettings(resolution="2ppd", calibration_sigma=0.05, units_per_if=3000.0, memory_mb=8.0, **LIMITS)
    made = build_mosaic(store[0], tmp_path / "map.zarr", settings)
    assert block_side(len(made.members), 8.0) == 64
    assert blocks_per_file(made.grid.shape, 64, 8.0) == 5
    with xr.open_zarr(tmp_path / "map.zarr") as dataset:
        found = dataset.reflectance.values
        assert dataset.reflectance.encoding["chunks"] == (64, 64)
        assert dataset.reflectance.encoding["shards"] == (320, 320)
    files = list((tmp_path / "map.zarr" / "reflectance" / "c").rglob("[0-9]*/[0-9]*"))
    assert 1 <= len(files) <= 2 * 3  # one that shows nothing is not written
    usual = mosaic[1].reflectance.values
    assert np.array_equal(np.isfinite(found), np.isfinite(usual))
    assert found[np.isfinite(found)] == pytest.approx(usual[np.isfinite(usual)], rel=2e-3)


@pytest.fixture(scope="module")
def coarse(store, tmp_path_factory):
    path = tmp_path_factory.mktemp("coarse") / "map.zarr"
    made = build_mosaic(store[0], path, MosaicSettings(**COARSE))
    with xr.open_zarr(path) as dataset:
        return made, dataset.load()


@pytest.mark.parametrize(
    ("shape", "memory_mb", "several"),
    [((360, 720), 256.0, 1), ((5760, 11520), 256.0, 2), ((49_000, 98_000), 256.0, 4), ((49_000, 98_000), 1.0, 1)],
)
def test_files_of_a_large_map_hold_several_blocks_where_there_is_memory(shape, memory_mb, several) -> None:
    assert blocks_per_file(shape, 512, memory_mb) == several


def test_a_cosmic_ray_in_one_of_several_images_is_left_out(store, coarse, tmp_path) -> None:
    spoiled = tmp_path / "spoiled"
    shutil.copytree(store[0], spoiled)
    clean, before = coarse
    row, column = np.argwhere((before["count"].values >= 4) & (before.incidence.values < 45))[0]
    number = int(before.image_index.values[row, column])
    view = load_view(clean.members[number].folder)
    from tasks.project.points import pixels_of_points, surface_points

    place = surface_points(view.target, before.lat.values[row], before.lon.values[column])
    x, y = np.rint(pixels_of_points(view.pose, view.camera, place)).astype(int)
    import zarr

    cube = zarr.open_group(str(spoiled / clean.members[number].folder.name / "cube.zarr"), mode="r+")
    image = cube["image"][...]
    image[y - 1 : y + 2, x - 1 : x + 2] += 4000
    cube["image"][...] = image
    load_view.cache_clear()
    build_mosaic(spoiled, tmp_path / "after.zarr", MosaicSettings(**COARSE))
    load_view.cache_clear()
    with xr.open_zarr(tmp_path / "after.zarr") as dataset:
        after = dataset.load()
    change = abs(float(after.reflectance[row, column] / before.reflectance[row, column]) - 1)
    assert change < 0.02
    assert int(after["count"][row, column]) < int(before["count"][row, column])


@pytest.mark.parametrize("projection", ["orthographic", "polar-stereographic"])
def test_other_projections_and_bands_have_the_same_values(store, mosaic, tmp_path, projection: str) -> None:
    settings = MosaicSettings(**COARSE, projection=projection, bands="camera")
    made = build_mosaic(store[0], tmp_path / "map.zarr", settings)
    files = write_forms(made, ("cog", "stac"))
    assert len(files) == len(made.models) + 1 >= 3
    import rasterio

    with xr.open_zarr(tmp_path / "map.zarr") as dataset, rasterio.open(files[0]) as tiff:
        assert dataset.reflectance.dims == ("band", "y", "x")
        assert dataset.band.attrs["bands"] == sorted({member.band for member in made.members})
        first = dataset.reflectance.isel(band=0).values
        assert np.array_equal(tiff.read(1), first, equal_nan=True)
        assert np.isfinite(first).sum() > 500
    item = json.loads(files[-1].read_text())
    assert set(item["assets"]) == {"zarr", *(f"cog-{band}" for band in made.models)}


@pytest.mark.parametrize(
    ("wrong", "error"),
    [
        ({"resolution": "fine"}, WrongOptionError),
        ({"resolution": "-4ppd"}, WrongOptionError),
        ({"resolution": "0.1m"}, RefusedError),
        ({"projection": "mercator"}, RefusedError),
        ({"held": {"zeal": 1.0}}, RefusedError),
        ({"law": "oren-nayar"}, RefusedError),
        ({"max_incidence_deg": 1.0, "max_emission_deg": 1.0}, RefusedError),
    ],
)
def test_what_makes_no_mosaic_is_refused_and_leaves_nothing(store, tmp_path, wrong, error) -> None:
    from catalog.errors import PlanetposeError

    with pytest.raises(error if error is WrongOptionError else PlanetposeError):
        build_mosaic(store[0], tmp_path / "map.zarr", MosaicSettings(**wrong))
    assert list(tmp_path.iterdir()) == []


def test_unknown_weights_and_bands_are_wrong_options() -> None:
    for wrong in ({"weights": "beauty"}, {"bands": "hue"}):
        with pytest.raises(WrongOptionError):
            MosaicSettings(**wrong)


def test_resolutions_are_read_in_their_units() -> None:
    europa = find_target("europa")
    assert pixel_size_km("10km", europa) == 10
    assert pixel_size_km("500 m", europa) == 0.5
    grid = mosaic_grid("equirectangular", europa, pixel_size_km("4ppd", europa), (0.0, 0.0), None)
    assert grid.shape == (720, 1440)


def test_the_command_writes_all_forms_and_names_what_was_left_out(store, tmp_path, monkeypatch) -> None:
    import contextlib
    import sys

    monkeypatch.setattr("flows.cli.output.clean_stdout", lambda: contextlib.nullcontext(sys.stdout))
    spoiled = tmp_path / "spoiled"
    shutil.copytree(store[0], spoiled)
    broken = sorted(spoiled.glob("C205*"))[0]
    (broken / "cube.zarr" / "image" / "zarr.json").write_text("{")
    (broken / "cube.zarr" / "zarr.json").write_text("{")
    command = [
        "mosaic",
        str(spoiled),
        "--law",
        "lunar-lambert",
        "--resolution",
        "1ppd",
        "--out",
        str(tmp_path / "m.zarr"),
    ]
    done = CliRunner().invoke(build_app(), [*command, "--format", "cog", "--format", "stac", "--json"])
    assert done.exit_code == 1, done.output
    summary = json.loads(done.stdout.splitlines()[0])
    assert [each["product"] for each in summary["left_out"]] == [broken.name]
    assert summary["unit"].startswith("image units")
    assert {path.name for path in tmp_path.iterdir()} == {"spoiled", "m.zarr", "m.tif", "m.json"}
    for wrong in (["--law", "x"], ["--weights", "x"], ["--bands", "x"], ["--resolution", "x"], ["--format", "x"]):
        assert CliRunner().invoke(build_app(), [*command, *wrong]).exit_code == 2, wrong
