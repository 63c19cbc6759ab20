"""What the distortion does to products of real images: SSIM against VICAR's, and cubes of unresampled pixels."""

import json
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import spiceypy
import xarray as xr
from numpy.typing import NDArray
from real_bench import shorter
from scipy.ndimage import map_coordinates

from catalog.camera import camera_from_dict
from catalog.observation import Quality
from catalog.pose import Pose
from catalog.readers import read_frame
from catalog.rotation import nearest_rotation
from catalog.target import Target
from flows.one_image import one_result
from flows.progress import Silent
from flows.request import Request
from tasks.project.planes import project_planes
from tasks.publish.cube import open_cube
from tasks.step import run

pytestmark = pytest.mark.real

EUROPA, IO, VICARS_IO = "galileo/C0552809300R.IMG", "voyager/f1636832.raw", "voyager/f1636832.geo"
# Archived C-matrix of f1636832 (rows: sample axis, line axis, boresight, in B1950), from JPL's VICAR logs.
IO_CAMERA_FROM_B1950 = [
    [0.595661, 0.568173, 0.567773],
    [0.174710, 0.598289, -0.782002],
    [-0.784005, 0.565004, 0.257112],
]


@pytest.fixture(scope="module")
def results(data_folder: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, Any]]:
    """Each with its own corrected pose; what is raw, with marks measured in the frame and in sensor space."""
    folder = tmp_path_factory.mktemp("cubes")
    matrix = nearest_rotation(np.array(IO_CAMERA_FROM_B1950)) @ spiceypy.pxform("J2000", "B1950", 0.0)
    pose_file = folder / "io.json"
    pose_file.write_text(json.dumps({"camera_from_j2000": nearest_rotation(matrix).tolist()}))
    profile = shorter(2)
    measured = profile.undistort.model_copy(update={"marks": "auto", "space": "sensor"})
    io = {"target": "io", "pose_file": pose_file}
    requests = {
        name: Request(
            image=data_folder / "images" / name,
            kernels=(data_folder / "kernels",),
            store=folder / Path(name).suffix,
            cache=folder / "cache",
            profile=profile.model_copy(update={"undistort": measured}) if name != VICARS_IO else profile,
            **(io if name != EUROPA else {}),
        )
        for name in (IO, VICARS_IO, EUROPA)
    }
    with ThreadPoolExecutor(2) as pool:
        found = pool.map(lambda request: one_result(request, Silent(), run_step=run), requests.values())
        return dict(zip(requests, found, strict=True))


def test_the_simulation_resembles_our_undistorted_image_more_than_vicars(results: dict[str, dict[str, Any]]) -> None:
    """The paper's figure 13."""
    for name in (IO, VICARS_IO):
        assert results[name]["status"] == "ok", results[name]["reason"]
    ours, vicars = (results[name]["similarity"]["after"] for name in (IO, VICARS_IO))
    print(f"SSIM against the simulation: f1636832 undistorted by us {ours:.3f}, by VICAR {vicars:.3f}")
    for name in (IO, VICARS_IO):
        print(f"  {name}: limb {results[name]['limb_rms_px']:.3f} px rms, range x {results[name]['range_factor']:.5f}")
    assert ours > vicars + 0.02
    assert ours > 0.80


@pytest.mark.parametrize("name", [EUROPA, IO])
def test_a_sensor_cube_holds_the_files_pixels(results: dict[str, dict[str, Any]], data_folder: Path, name: str) -> None:
    image = read_frame(data_folder / "images" / name).observation.image
    with open_cube(Path(results[name]["cube"])) as cube:
        filled = (cube["quality"].values & Quality.RESEAU) != 0
        same = cube["image"].values == image
        assert cube.attrs["pixel_space"] == "sensor"
        assert cube["resampled_image"].shape == ((1000, 1000) if name == IO else (800, 800))
    print(f"{name}: {same.sum()} of {same.size} pixels are the file's, {filled.sum()} are flagged as marks")
    assert same[~filled].all()
    assert filled.any() == (name == IO)


@pytest.mark.parametrize("name", [EUROPA, IO])
def test_its_coordinates_are_those_of_the_undistorted_frame_at_the_pixels_places(
    results: dict[str, dict[str, Any]], name: str
) -> None:
    with open_cube(Path(results[name]["cube"])) as lazy:
        cube = lazy.load()
    content = {key: json.loads(cube.attrs[key]) for key in ("pose_after", "camera_model", "target_model")}
    camera, target = camera_from_dict(content["camera_model"], "of the cube"), Target(**content["target_model"])
    planes = project_planes(Pose.from_dict(content["pose_after"]), camera, target)
    away = (cube["emission"].values < 60) & (np.abs(cube["latitude"].values) < 75)
    largest = {}
    for plane in ("latitude", "longitude"):
        there = at_places(planes[plane], cube)
        off = np.abs(there - cube[plane].values)[away & ~beside_seam(cube)]
        largest[plane] = float(off.max())
    print(f"{name}: {away.sum()} pixels, largest differences in degrees {largest}")
    assert away.sum() > 20_000
    assert max(largest.values()) < 1e-3


def at_places(plane: NDArray[np.float64], cube: xr.Dataset) -> NDArray[np.float64]:
    """A plane of the undistorted frame at the cube's places, by cubic splines; what is off the body counts as 0, which
    a spline forgets within ten pixels."""
    where = [cube["place_y"].values.astype(np.float64), cube["place_x"].values.astype(np.float64)]
    return np.asarray(map_coordinates(np.nan_to_num(plane), where, order=3))


def beside_seam(cube: xr.Dataset) -> NDArray[np.bool_]:
    """Where longitude jumps from 360 to 0 within the reach of a spline."""
    longitude = cube["longitude"].values
    return (longitude < 15) | (longitude > 345)


def test_the_distortions_error_goes_on_to_the_coordinates(results: dict[str, dict[str, Any]]) -> None:
    with open_cube(Path(results[IO]["cube"])) as cube:
        place_px = cube["distortion_uncertainty"].values
        on_body = np.isfinite(cube["latitude"].values)
        sigma = np.nanmedian(cube["latitude_uncertainty"].values)
        assert "not_included" not in cube["latitude_uncertainty"].attrs
    print(f"f1636832: distortion {np.median(place_px[on_body]):.3f} px on the disk, latitude {sigma:.4f} deg (medians)")
    assert 0.05 < np.median(place_px[on_body]) < 0.3
    with open_cube(Path(results[EUROPA]["cube"])) as cube:  # a model of the optics without an error of its own
        assert cube["latitude_uncertainty"].attrs["not_included"] == "distortion"
