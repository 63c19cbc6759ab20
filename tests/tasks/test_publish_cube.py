"""The geometry cube: its contents, its conventions, and its way through Zarr."""

import json

import numpy as np
import pytest
import xarray as xr
from scipy.spatial.transform import Rotation
from small_product import write_cube

from catalog.camera import Camera
from catalog.observation import Observation, Quality
from catalog.pose import Pose
from catalog.target import Target
from tasks.project.backplanes import PLANES
from tasks.project.planes import project_planes
from tasks.project.uncertainty import PoseUncertainty
from tasks.publish import Publication
from tasks.publish.cube import cube_dataset, open_cube
from tasks.publish.planes import rounded_to_bits
from tasks.publish.variables import REQUIRED_ATTRIBUTES, VARIABLES, cube_faults

CAMERA = Camera(name="test", size_px=(120, 100), centre_px=(60.0, 50.0), focal_length_px=2e4, psf_sigma_px=0.5)
EUROPA = Target(
    name="europa", naif_id=502, radii_km=(1562.6, 1560.3, 1559.5), body_frame="IAU_EUROPA", iau_crs="IAU_2015:50200"
)


def publication_of(camera=CAMERA, target=EUROPA, **changes):
    rng = np.random.default_rng(5)
    shape = camera.size_px[::-1]
    quality = np.zeros(shape, np.uint16)
    quality[10, 20] = Quality.SATURATED
    image = rng.normal(100, 5, shape).astype(np.float32)
    body = Rotation.from_euler("xz", [75, 20], degrees=True).as_matrix()
    after = Pose(1.2e7, np.eye(3), np.array([20.0, 30.0, 8.2e5]), np.array([4e8, 1e8, -6e8]), body)
    before = after.replaced(target_from_spacecraft_km=np.array([520.0, -330.0, 8.2e5]))
    sigmas = {"offset_px": [0.1, 0.2], "range_factor": 3e-4, "attitude_deg": [0.03, 0.04, 0.05]}
    given = {
        "product": "C0001",
        "observation": Observation(image, np.ones(shape, np.float32), quality),
        "camera": camera,
        "target": target,
        "pose_before": before,
        "pose_after": after,
        "uncertainty": PoseUncertainty.from_sigmas(sigmas),
        "result": {"status": "ok", "uncertainty": sigmas},
        "settings": {"profile": "standard"},
        "provenance": {"image_sha256": "ab12", "kernels": [{"name": "pck00010.tpc", "sha256": "cd34"}]},
    }
    return Publication(**{**given, **changes})


@pytest.fixture(scope="module")
def publication():
    return publication_of()


@pytest.fixture(scope="module")
def cube(publication):
    return cube_dataset(publication)


def test_a_cube_comes_back_from_zarr_as_it_went_in(cube, tmp_path):
    write_cube(cube, tmp_path / "cube.zarr")
    with xr.open_zarr(tmp_path / "cube.zarr") as back:
        xr.testing.assert_identical(back.load().drop_encoding(), cube)
        assert set(back.coords) == {"x", "y", "latitude", "longitude"}
        assert cube_faults(back) == []
    metadata = json.loads((tmp_path / "cube.zarr" / "zarr.json").read_text())
    assert metadata["zarr_format"] == 3
    assert set(metadata["consolidated_metadata"]["metadata"]) == set(cube.variables)
    array = json.loads((tmp_path / "cube.zarr" / "emission" / "zarr.json").read_text())
    assert array["chunk_grid"]["configuration"]["chunk_shape"] == [100, 120]
    blosc = next(codec for codec in array["codecs"] if codec["name"] == "blosc")["configuration"]
    assert (blosc["cname"], blosc["clevel"], blosc["shuffle"]) == ("zstd", 3, "shuffle")
    assert array["dimension_names"] == ["y", "x"]
    assert set(array["attributes"]["coordinates"].split()) == {"latitude", "longitude"}


def test_a_cube_opens_lazily_with_the_projection_of_the_corrected_pose(publication, cube, tmp_path):
    write_cube(cube, tmp_path / "cube.zarr")
    planes = project_planes(publication.pose_after, CAMERA, EUROPA)
    with open_cube(tmp_path / "cube.zarr") as back:
        assert back["phase"].chunks == ((100,), (120,))
        for name in PLANES:
            assert np.allclose(back[name].values, planes[name], rtol=2e-7, equal_nan=True), name
        assert np.array_equal(back["image"].values, publication.observation.image)


def test_every_variable_carries_its_cf_attributes(cube):
    standard = {name: cube[name].attrs.get("standard_name") for name in cube.variables}
    assert standard["latitude"] == "latitude"
    assert standard["longitude"] == "longitude"
    assert standard["incidence"] == "solar_zenith_angle"
    assert standard["emission"] == "sensor_zenith_angle"
    assert standard["phase"] is None
    assert cube["longitude"].attrs["units"] == "degrees_east"
    assert {cube[v.name].attrs["grid_mapping"] for v in VARIABLES} == {"crs"}
    assert cube.attrs["Conventions"].startswith("CF-1.")
    assert all(cube[v.name].attrs["long_name"] and cube[v.name].attrs["units"] for v in VARIABLES)
    quality = cube["quality"].attrs
    assert len(quality["flag_masks"]) == len(quality["flag_meanings"].split()) == len(Quality)
    assert quality["flag_meanings"].split()[quality["flag_masks"].index(int(Quality.NIGHT_SIDE))] == "night_side"


def test_the_crs_is_the_body_s_iau_code_with_the_triaxial_radii_beside_it(cube):
    from pyproj import CRS

    crs = cube["crs"].attrs
    assert CRS.from_cf(crs).to_authority() == ("IAU_2015", "50200")
    assert crs["grid_mapping_name"] == "latitude_longitude"
    assert crs["triaxial_radii_km"] == [1562.6, 1560.3, 1559.5]


def test_a_body_without_iau_code_gets_a_sphere_of_its_mean_radius():
    target = Target(name="rock", naif_id=9, radii_km=(1500.0, 1300.0, 1100.0))
    crs = cube_dataset(publication_of(target=target))["crs"].attrs
    assert crs["semi_major_axis"] == pytest.approx(target.mean_radius_km * 1e3)
    assert "iau_code" not in crs


def test_provenance_is_complete_and_readable(publication, cube):
    assert set(REQUIRED_ATTRIBUTES) <= set(cube.attrs)
    before, after = (Pose.from_dict(json.loads(cube.attrs[key])) for key in ("pose_before", "pose_after"))
    assert np.array_equal(after.camera_from_j2000, publication.pose_after.camera_from_j2000)
    assert np.array_equal(before.target_from_spacecraft_km, publication.pose_before.target_from_spacecraft_km)
    assert json.loads(cube.attrs["provenance"])["kernels"][0]["name"] == "pck00010.tpc"
    assert json.loads(cube.attrs["settings"]) == {"profile": "standard"}
    uncertainty = json.loads(cube.attrs["uncertainty"])
    assert uncertainty["range_factor"] == 3e-4
    assert np.shape(uncertainty["covariance"]) == (7, 7)
    assert Camera.model_validate(json.loads(cube.attrs["camera_model"])) == CAMERA
    assert cube.attrs["utc"].endswith("Z")
    assert cube.attrs["source"].startswith("planetpose ")


def test_flags_tell_sky_night_limb_and_detector_faults_apart(publication, cube):
    quality = cube["quality"].values
    planes = project_planes(publication.pose_after, CAMERA, EUROPA)
    assert np.array_equal((quality & Quality.OFF_BODY) != 0, ~planes.on_body)
    night = (quality & Quality.NIGHT_SIDE) != 0
    assert np.array_equal(night, planes.on_body & (planes.incidence >= 90))
    assert night.any()
    assert np.isfinite(cube["incidence"].values[night]).all()
    limb = (quality & Quality.LIMB) != 0
    assert (limb & planes.on_body).any()
    assert (limb & ~planes.on_body).any()
    assert np.nanmin(planes.emission[limb]) > 65
    assert quality[10, 20] & Quality.SATURATED


def test_a_longitude_just_below_360_does_not_round_up_to_it():
    turned = Rotation.from_euler("z", -2e-6, degrees=True).as_matrix()
    sun = np.array([4e8, 1e8, -6e8])
    axes = np.array([[0, 0, -1.0], [1, 0, 0], [0, -1, 0]])  # the body's x axis towards the camera
    pose = Pose(0.0, np.eye(3), np.array([0, 0, 8.2e5]), sun, turned @ axes)
    longitude = project_planes(pose, CAMERA, EUROPA).longitude
    assert (longitude.astype(np.float32) >= 360).any()
    cube = cube_dataset(publication_of(pose_after=pose))
    assert np.nanmax(cube["longitude"].values) < 360


def test_uncertainties_are_stored_to_three_digits_and_say_what_they_leave_out():
    values = np.array([0.012345, 3.9999, 1e-6, 180.0, np.nan], np.float32)
    rounded = rounded_to_bits(values, 10)
    assert np.abs(rounded[:4] / values[:4] - 1).max() < 5e-4
    assert np.isnan(rounded[4])
    partly = cube_dataset(publication_of(uncertainty=PoseUncertainty.from_sigmas({"offset_px": [0.1, 0.1]})))
    assert partly["latitude_uncertainty"].attrs["not_included"] == "range_factor attitude_deg distortion"
    assert 0 < np.nanmin(partly["latitude_uncertainty"].values) < 1
    unknown = cube_dataset(publication_of(uncertainty=PoseUncertainty.from_sigmas({})))
    assert np.isnan(unknown["latitude_uncertainty"].values).all()


def test_the_distortions_uncertainty_is_merged_and_has_its_own_plane(publication, cube):
    """Where the pose knows nothing but an offset of 0.3 px in x and y, 0.4 px of distortion make it 0.5 px."""
    offset = PoseUncertainty.from_sigmas({"offset_px": [0.3, 0.3], "range_factor": 0, "attitude_deg": [0, 0, 0]})
    place = np.full(CAMERA.size_px[::-1], 0.4, np.float32)
    without, merged = (
        cube_dataset(publication_of(uncertainty=offset, distortion_uncertainty_px=p)) for p in (place * 0, place)
    )
    inside = ~np.isnan(cube["emission"].values) & (cube["emission"].values < 60)
    for name in ("latitude_uncertainty", "longitude_uncertainty"):
        ratio = merged[name].values[inside] / without[name].values[inside]
        assert np.abs(ratio * 0.3 / 0.5 - 1).max() < 2e-3, name
        assert "not_included" not in merged[name].attrs
        assert without[name].attrs["not_included"] == "distortion"
    assert np.allclose(merged["distortion_uncertainty"], 0.4, rtol=1e-3)
    assert np.isnan(cube["distortion_uncertainty"]).all()
    with pytest.raises(ValueError, match="distortion's uncertainty is"):
        publication_of(distortion_uncertainty_px=place[1:])


def spoiled(cube, name, change):
    copy = cube.copy(deep=True)
    change(copy[name])
    return copy


@pytest.mark.parametrize(
    ("spoil", "fault"),
    [
        (lambda c: c.drop_vars("phase"), "variable phase is missing"),
        (lambda c: c.drop_attrs(deep=False), "attribute provenance is missing"),
        (lambda c: c.assign(phase=c["phase"].astype(np.float64).assign_attrs(c["phase"].attrs)), "phase: type float64"),
        (lambda c: spoiled(c, "emission", lambda a: a.attrs.update(units="radian")), "attribute units is 'radian'"),
        (lambda c: spoiled(c, "latitude", lambda a: a.values.__iadd__(100)), "latitude: values from"),
        (lambda c: spoiled(c, "range_km", lambda a: a.values.fill(1)), "range_km: finite values and the off_body flag"),
        (lambda c: c.assign_coords(longitude=c["longitude"] * 0 + 360), "a longitude reaches 360"),
    ],
)
def test_a_cube_that_departs_from_the_table_is_found_out(cube, spoil, fault):
    assert cube_faults(cube) == []
    assert fault in "; ".join(cube_faults(spoil(cube)))


def test_a_frame_without_the_body_is_a_cube_of_sky():
    aside = Pose(0.0, np.eye(3), np.array([8.2e5, 0, 8.2e5]), np.array([4e8, 1e8, -6e8]), np.eye(3))
    cube = cube_dataset(publication_of(pose_after=aside))
    assert np.isnan(cube["latitude"].values).all()
    assert (cube["quality"].values & Quality.OFF_BODY).all()


def test_a_wrong_frame_size_or_product_name_is_refused():
    small = CAMERA.model_copy(update={"size_px": (64, 64)})
    with pytest.raises(ValueError, match="undistorted frame of test"):
        publication_of(observation=publication_of(camera=small).observation)
    for name in ("", "../up", ".hidden"):
        with pytest.raises(ValueError, match="no name for a folder"):
            publication_of(product=name)
