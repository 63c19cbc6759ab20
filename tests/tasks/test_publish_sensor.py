"""Cubes of unresampled pixels: their values are the file's, their geometry goes through the distortion model."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from scipy.ndimage import map_coordinates
from small_product import write_cube

from catalog.camera import Camera, known_cameras
from catalog.observation import Observation, Quality
from catalog.pose import Pose
from catalog.rotation import rotation_from_vector_deg
from catalog.target import Target
from planetpose import model_of, pixel_of, place_of
from tasks.project.backplanes import KNOWN_PLANES
from tasks.project.pixels import project_pixels
from tasks.project.planes import project_planes
from tasks.project.uncertainty import PoseUncertainty
from tasks.publish import Publication, publish, redraw_overlay
from tasks.publish.cube import cube_dataset, open_cube, plain_cube
from tasks.publish.plain_cube import write_plain_cube
from tasks.publish.publication import SensorFrame
from tasks.publish.sensor import pixel_sizes
from tasks.undistort import UndistortSettings, undistort
from tasks.undistort.frame_map import uncertainty_plane, undistorted_places

IO = Target(name="io", naif_id=501, radii_km=(1829.4, 1819.4, 1815.7), iau_crs="IAU_2015:50100")
CASES = ["voyager1-nac", "galileo-ssi"]


def pose_of(camera: Camera) -> Pose:
    """The disk, 240 px in radius, beside the frame's centre, where Voyager's distortion is larger."""
    to_target = camera.ray(np.add(camera.centre_px, (90.0, -70.0))) * (1820 * camera.focal_length_px / 240)
    return Pose(1e7, np.eye(3), to_target, np.array([4e8, 1e8, -6e8]), rotation_from_vector_deg([80.0, 10.0, 40.0]))


def publications(name: str) -> tuple[Publication, Publication]:
    """The same raw frame of noise, published resampled and in sensor space."""
    camera, rng = known_cameras()[name], np.random.default_rng(7)
    image = rng.uniform(20, 200, camera.detector_size_px[::-1]).astype(np.float32)
    quality = np.zeros(image.shape, np.uint16)
    quality[5, 6] = Quality.SATURATED
    raw = Observation(image, np.ones_like(image), quality)
    found = undistort(raw, camera, UndistortSettings(marks="nominal", fill_marks=False))
    given: dict[str, Any] = {
        "product": "C0001",
        "observation": found.observation,
        "camera": camera,
        "target": IO,
        "pose_before": pose_of(camera),
        "pose_after": pose_of(camera),
        "uncertainty": PoseUncertainty.from_sigmas(
            {"offset_px": [0.1, 0.1], "range_factor": 1e-4, "attitude_deg": [0.01] * 3}
        ),
        "kernel": "bilinear",
        "distortion_uncertainty_px": uncertainty_plane(found.model),
    }
    sensor = SensorFrame(raw, undistorted_places(found.model))
    return Publication(**given), Publication(**given, sensor=sensor)


@pytest.fixture(scope="module", params=CASES)
def cubes(request: pytest.FixtureRequest) -> tuple[Publication, xr.Dataset, xr.Dataset]:
    resampled, sensor = publications(request.param)
    return sensor, cube_dataset(resampled), cube_dataset(sensor)


def test_the_group_is_what_xarray_writes_byte_for_byte(tmp_path: Path) -> None:
    """Pixels of the detector, with a frame beside that has dimensions of its own."""
    made = plain_cube(publications(CASES[0])[1])
    write_plain_cube(made, tmp_path / "plain.zarr")
    write_cube(made.dataset(), tmp_path / "xarray.zarr")
    plain, theirs = (
        {str(path.relative_to(top)): path.read_bytes() for path in top.rglob("*") if path.is_file()}
        for top in (tmp_path / "plain.zarr", tmp_path / "xarray.zarr")
    )
    assert plain.keys() == theirs.keys()
    for name, content in plain.items():
        same = json.loads(content) == json.loads(theirs[name]) if name.endswith(".json") else content == theirs[name]
        assert same, name
    with pytest.raises(FileExistsError):
        write_plain_cube(made, tmp_path / "plain.zarr")


def at_places(plane: xr.DataArray, sensor: SensorFrame) -> np.ndarray:
    """A resampled plane at the raw pixels' places, linear, in float64."""
    y, x = sensor.xy_px[..., 1], sensor.xy_px[..., 0]
    return map_coordinates(plane.values.astype(np.float64), [y, x], order=1, mode="constant", cval=np.nan)


def test_values_are_the_files_and_attributes_say_so(cubes: tuple[Publication, xr.Dataset, xr.Dataset]) -> None:
    publication, resampled, cube = cubes
    assert publication.sensor is not None
    assert cube["image"].values.tobytes() == publication.sensor.observation.image.tobytes()
    assert (cube.attrs["pixel_space"], cube.attrs["resampling_kernel"]) == ("sensor", "none")
    assert (resampled.attrs["pixel_space"], resampled.attrs["resampling_kernel"]) == ("resampled", "bilinear")
    assert cube["x"].attrs["long_name"] == "sample of the raw frame"
    assert cube["quality"].values[5, 6] & Quality.SATURATED
    assert np.array_equal(cube["resampled_image"], resampled["image"])
    assert "place_x" not in resampled
    assert np.allclose(cube["place_x"], publication.sensor.xy_px[..., 0], atol=1e-4)


def test_coordinates_are_those_of_the_resampled_cube_at_the_pixels_undistorted_places(
    cubes: tuple[Publication, xr.Dataset, xr.Dataset],
) -> None:
    publication, resampled, cube = cubes
    sensor = publication.sensor
    assert sensor is not None
    away = (cube["emission"].values < 45) & (np.abs(cube["latitude"].values) < 75)
    away &= (cube["emission"].values > 3) & (cube["incidence"].values > 3)  # both are cones with a tip at 0
    assert away.sum() > 20_000
    off = {}
    for name in ("latitude", "longitude", "incidence", "emission", "phase"):
        there = at_places(resampled[name], sensor)[away]
        off[name] = np.abs((there - cube[name].values[away] + 180) % 360 - 180)
    seam = off["longitude"] > 0.1  # between 359.9 and 0.1 degrees nothing can be interpolated
    largest = {name: float(values[~seam].max()) for name, values in off.items()}
    print(f"{publication.camera.name}, {away.sum()} pixels: largest differences in degrees {largest}")
    assert seam.mean() < 0.01
    assert max(largest["latitude"], largest["longitude"]) < 1e-3
    assert max(largest.values()) < 5e-3


def test_uncertainties_are_those_at_the_places(cubes: tuple[Publication, xr.Dataset, xr.Dataset]) -> None:
    publication, resampled, cube = cubes
    sensor = publication.sensor
    assert sensor is not None
    away = cube["emission"].values < 45
    for name in ("latitude_uncertainty", "distortion_uncertainty"):
        there = at_places(resampled[name], sensor)[away]
        assert np.abs(cube[name].values[away] - there).max() < 2e-3 * max(there.max(), 1e-9), name


def test_the_resolution_is_that_of_a_raw_pixel(cubes: tuple[Publication, xr.Dataset, xr.Dataset]) -> None:
    publication, resampled, cube = cubes
    ratio = np.nanmedian(cube["resolution_km"]) / np.nanmedian(resampled["resolution_km"])
    assert ratio == pytest.approx({"voyager1-nac": 1.18, "galileo-ssi": 1.0}[publication.camera.name], abs=0.03)


def test_a_sensor_product_is_drawn_in_the_undistorted_frame_also_from_its_cube(tmp_path: Path) -> None:
    resampled, sensor = publications("voyager1-nac")
    pictures = [(publish(p, tmp_path / p.pixel_space) / "overlay.png") for p in (resampled, sensor)]
    assert pictures[0].read_bytes() == pictures[1].read_bytes()
    pictures[1].unlink()
    assert redraw_overlay(pictures[1].parent).read_bytes() == pictures[0].read_bytes()
    with open_cube(pictures[1].parent / "cube.zarr") as cube:
        assert cube["image"].shape == (800, 800)
        assert cube["resampled_image"].shape == (1000, 1000)


def test_pixels_without_a_place_see_nothing_and_are_flagged() -> None:
    _, publication = publications("galileo-ssi")
    assert publication.sensor is not None
    places = publication.sensor.xy_px.copy()
    places[300:310, 400:410] = np.nan
    gappy = Publication(**{**vars(publication), "sensor": SensorFrame(publication.sensor.observation, places)})
    cube = cube_dataset(gappy)
    assert np.isnan(cube["latitude"].values[300:310, 400:410]).all()
    assert (cube["quality"].values[300:310, 400:410] & Quality.EXTRAPOLATED_DISTORTION).all()
    assert np.isfinite(cube["resolution_km"].values[310, 405])
    with pytest.raises(ValueError, match="places"):
        SensorFrame(publication.sensor.observation, places[1:])


def test_single_pixels_and_the_compiled_projection_agree() -> None:
    camera = known_cameras()["galileo-ssi"].model_copy(update={"size_px": (300, 280), "centre_px": (140.0, 130.0)})
    planes = project_planes(pose_of(camera), camera, IO, planes=KNOWN_PLANES)
    xy = np.stack(np.meshgrid(np.arange(300), np.arange(280)), axis=-1)
    pixels = project_pixels(pose_of(camera), camera, IO, xy, KNOWN_PLANES)
    for name in KNOWN_PLANES:
        assert np.allclose(pixels[name], planes[name], rtol=1e-9, atol=1e-8, equal_nan=True), name


def test_pixel_sizes_are_roots_of_areas() -> None:
    x, y = np.meshgrid(np.arange(20.0), np.arange(10.0))
    assert np.allclose(pixel_sizes(np.stack([2 * x + 0.1 * y, 0.5 * y], axis=-1)), 1.0)


@pytest.mark.parametrize("name", CASES)
def test_places_and_pixels_of_a_cube_belong_together(name: str) -> None:
    """In the cube's own pixels, raw or undistorted, and as its planes have it."""
    for publication in publications(name):
        cube = cube_dataset(publication)
        ys, xs = np.nonzero(cube.emission.values < 75)
        chosen = np.random.default_rng(1).integers(0, len(ys), 200)
        xs, ys = xs[chosen], ys[chosen]
        latitude, longitude = place_of(cube, xs, ys)
        np.testing.assert_allclose(latitude, cube.latitude.values[ys, xs], atol=2e-4)
        off = np.abs(longitude - cube.longitude.values[ys, xs]) * np.cos(np.radians(latitude))
        assert np.minimum(off, 360 - off).max() < 2e-4
        np.testing.assert_allclose(pixel_of(cube, latitude, longitude), [xs, ys], atol=2e-4)
        part = cube.isel(x=slice(7, None), y=slice(9, None))
        between = place_of(part, xs + 0.3, ys - 0.4)
        np.testing.assert_allclose(pixel_of(model_of(part), *between), [xs + 0.3, ys - 0.4], atol=2e-4)
