"""Maps: what is planted at a known place on the body is at that place on every map, also at poles and seams."""

import numpy as np
import pytest
from small_product import EUROPA, pose_of, small_publication, write_cube

from catalog.errors import RefusedError
from catalog.observation import Observation, Quality
from catalog.pose import Pose
from tasks.export.geotiff import write_geotiff
from tasks.export.map_grid import body_crs, grid_of, map_projection
from tasks.export.map_image import LAYERS, map_image
from tasks.export.source import read_source
from tasks.project.planes import project_planes
from tasks.project.points import pixels_of_points, surface_points
from tasks.publish.cube import cube_dataset
from tasks.publish.publication import SensorFrame

PROJECTIONS = ("equirectangular", "orthographic", "polar-stereographic")
SPOT_SIGMA_PX = 1.2


def looking_at(latitude_deg: float, longitude_deg: float, radius_px: float = 60.0) -> Pose:
    """Spacecraft above a place, north upward, Sun behind it."""
    up = surface_points(EUROPA, latitude_deg, longitude_deg)
    up = up / np.linalg.norm(up)
    right = np.cross([0.0, 0.0, 1.0], up)
    right /= np.linalg.norm(right)
    camera_from_body = np.stack([right, np.cross(-up, right), -up])
    away = np.array([0.0, 0.0, 1560 * 2e4 / radius_px])
    return Pose(0.0, np.eye(3), away, np.array([1e8, 1e8, -7e8]), camera_from_body.T)


def spot_product(folder, pose: Pose, spots: list[tuple[float, float]], quality: np.ndarray | None = None):
    """A product whose image is dark but for Gaussian spots at (latitude, longitude)."""
    plain = small_publication("S", pose_after=pose)
    y, x = np.indices(plain.observation.image.shape)
    image = np.zeros(x.shape, np.float32)
    for latitude, longitude in spots:
        place = pixels_of_points(pose, plain.camera, surface_points(EUROPA, latitude, longitude))
        image += np.exp(-((x - place[0]) ** 2 + (y - place[1]) ** 2) / (2 * SPOT_SIGMA_PX**2)).astype(np.float32)
    flags = np.zeros(x.shape, np.uint16) if quality is None else quality
    observation = Observation(image, np.full_like(image, 0.01), flags)
    write_cube(cube_dataset(small_publication("S", pose_after=pose, observation=observation)), folder / "cube.zarr")
    return read_source(folder)


VIEWS = {
    "the middle": ((20.0, 130.0), (10.0, 120.0)),
    "the seam at 0/360": ((15.0, 0.0), (5.0, 359.7)),
    "the seam at 180": ((-15.0, 179.0), (-20.0, 180.2)),
    "near the north pole": ((70.0, 40.0), (88.0, 220.0)),
    "near the south pole": ((-65.0, 300.0), (-87.0, 100.0)),
}


@pytest.fixture(scope="module")
def sources(tmp_path_factory):
    folder = tmp_path_factory.mktemp("spots")
    return {name: spot_product(folder / name, looking_at(*centre), [spot]) for name, (centre, spot) in VIEWS.items()}


@pytest.mark.parametrize("projection", PROJECTIONS)
@pytest.mark.parametrize("view", VIEWS)
def test_a_spot_is_within_half_a_pixel_of_its_place_on_the_map(sources, view, projection):
    """Weighted by the map's area per pixel, and compared where the spot is: on the body, in pixels of the map."""
    source, (latitude, longitude) = sources[view], VIEWS[view][1]
    mapped = map_image(source, projection, kernel="cubic")
    grid, image = mapped.grid, np.nan_to_num(mapped.layers["image"])
    map_latitude, map_longitude = grid.projection.latitude_longitude(*np.meshgrid(grid.x_m(), grid.y_m()))
    with np.errstate(invalid="ignore"):
        weight = np.where(image > 0.05, image, 0.0) * pixel_area(grid, map_latitude)
    points = np.nan_to_num(surface_points(EUROPA, map_latitude, map_longitude))
    centre = (points * weight[..., None]).sum(axis=(0, 1)) / weight.sum()
    planted = surface_points(EUROPA, latitude, longitude)
    off_km = np.linalg.norm(centre / np.linalg.norm(centre) - planted / np.linalg.norm(planted)) * 1560
    print(f"{view}, {projection}: {off_km / (grid.step_m / 1e3):.3f} px of the map")
    assert off_km < 0.5 * grid.step_m / 1e3
    x_m, y_m = grid.projection.map_place(np.array(latitude), np.array(longitude))
    column, row = (x_m - grid.x0_m) / grid.step_m, (grid.y0_m - y_m) / grid.step_m
    near = image[max(int(row) - 1, 0) : int(row) + 2, max(int(column) - 1, 0) : int(column) + 2]
    assert near.max() > 0.8 * image.max()


def pixel_area(grid, latitude_deg):
    """Area on the sphere of a pixel of the map, to a common factor."""
    name = grid.projection.name
    if name == "equirectangular":
        return np.cos(np.radians(latitude_deg))
    if name == "polar-stereographic":
        return (1 + np.abs(np.sin(np.radians(latitude_deg)))) ** 2
    x, y = np.meshgrid(grid.x_m(), grid.y_m())
    radius2 = grid.projection.extent_m[2] ** 2
    return 1 / np.sqrt(np.clip(1 - (x**2 + y**2) / radius2, 0.01, 1))


def test_angles_are_those_of_the_projection_at_the_same_place(sources):
    source = sources["the middle"]
    mapped = map_image(source)
    grid = mapped.grid
    row, column = np.array(grid.shape) // 2
    latitude, longitude = grid.projection.latitude_longitude(grid.x_m()[[column]], grid.y_m()[[row]])
    place = pixels_of_points(source.pose, source.camera, surface_points(EUROPA, latitude, longitude))[0]
    x, y = np.rint(place).astype(int)
    planes = project_planes(source.pose, source.camera, EUROPA)
    for name in ("incidence", "emission", "phase"):
        assert mapped.layers[name][row, column] == pytest.approx(planes[name][y, x], abs=1.5)
    assert np.nanmax(mapped.layers["emission"]) <= 85
    assert set(mapped.layers) == set(LAYERS)


def test_a_map_of_the_pole_reaches_all_longitudes_and_no_column_is_there_twice(sources):
    mapped = map_image(sources["near the north pole"])
    grid = mapped.grid
    assert grid.shape[1] * grid.step_m == pytest.approx(2 * np.pi * 1560800)
    assert grid.y0_m == pytest.approx(np.pi / 2 * 1560800)
    assert np.isfinite(mapped.layers["emission"][0]).all()
    _, longitude = grid.projection.latitude_longitude(grid.x_m(), np.zeros(grid.shape[1]))
    assert len(np.unique(np.round(longitude, 6))) == grid.shape[1]


def test_unusable_pixels_are_holes_and_the_rest_of_the_image_is_not_touched(tmp_path):
    quality = np.zeros((160, 160), np.uint16)
    quality[80, 75:85] = Quality.MISSING
    quality[:, 110:] = Quality.OUTSIDE_WINDOW
    source = spot_product(tmp_path, pose_of(60.0), [], quality)
    source.cube["image"].values[:] = 7.0
    for kernel in ("nearest", "bilinear", "cubic"):
        mapped = map_image(source, "orthographic", kernel=kernel)
        image, on_map = mapped.layers["image"], np.isfinite(mapped.layers["emission"])
        assert np.nanmin(image) == pytest.approx(7, abs=1e-4)
        assert np.nanmax(image) == pytest.approx(7, abs=1e-4)
        holes = on_map & ~np.isfinite(image)
        assert 0.02 < holes.sum() / on_map.sum() < 0.5


def test_a_coarse_map_averages_and_a_fine_one_interpolates(sources):
    source = sources["the middle"]
    totals = []
    for factor in (0.5, 1.0, 4.0):
        mapped = map_image(source, "orthographic", resolution_km=26 * factor)
        totals.append(float(np.nansum(mapped.layers["image"])) * mapped.grid.step_m**2)
    assert totals == pytest.approx([totals[0]] * 3, rel=0.03)


def test_what_cannot_be_mapped_is_refused(sources, tmp_path):
    source = sources["the middle"]
    for wrong, message in (
        ({"projection": "mercator"}, "no projection"),
        ({"resolution_km": -1.0}, "a resolution of"),
        ({"resolution_km": 0.0}, "a resolution of"),
        ({"resolution_km": 0.05}, "a map of"),
        ({"kernel": "lanczos"}, "no resampling kernel"),
        ({"max_emission_deg": 0.0}, "shows nothing of europa"),
    ):
        with pytest.raises(RefusedError, match=message):
            map_image(source, **wrong)
    with pytest.raises(RefusedError, match="holds no cube"):
        read_source(tmp_path)


def test_maps_of_bodies_with_and_without_an_iau_code_have_a_named_sphere():
    assert body_crs(EUROPA).to_authority() == ("IAU_2015", "50200")
    rock = EUROPA.model_copy(update={"name": "rock", "iau_crs": None})
    crs = body_crs(rock)
    assert crs.ellipsoid.semi_major_metre == pytest.approx(rock.mean_radius_km * 1e3)
    assert not crs.to_wkt().startswith("PROJ")
    projection = map_projection("equirectangular", rock, 10.0, (0.0, 250.0))
    grid = grid_of(projection, projection.extent_m)
    assert grid.shape[1] == 2 * grid.shape[0]
    assert projection.crs.coordinate_operation.to_json_dict()["parameters"][1]["value"] in (0, 180)


def test_a_cube_of_raw_pixels_is_mapped_from_the_undistorted_frame_with_its_unusable_pixels_as_holes(tmp_path):
    pose, spot = looking_at(20.0, 130.0), (10.0, 120.0)
    undistorted = small_publication("S", pose_after=pose).observation
    place = pixels_of_points(pose, small_publication().camera, surface_points(EUROPA, *spot))
    y, x = np.indices(undistorted.image.shape)
    image = np.exp(-((x - place[0]) ** 2 + (y - place[1]) ** 2) / (2 * SPOT_SIGMA_PX**2)).astype(np.float32)
    places = np.stack([3.0 + 0.96 * x, 2.0 + 0.97 * y], axis=-1)  # where the raw pixels are in the undistorted frame
    quality = np.zeros(image.shape, np.uint16)
    quality[90:93, 90:93] = Quality.RESEAU
    sensor = SensorFrame(Observation(np.full_like(image, 5), np.ones_like(image), quality), places)
    observation = Observation(image, undistorted.noise, undistorted.quality)
    write_cube(
        cube_dataset(small_publication("S", pose_after=pose, observation=observation, sensor=sensor)),
        tmp_path / "cube.zarr",
    )
    source = read_source(tmp_path)
    known = np.isfinite(source.undistorted_image())
    hole = places[91, 91]
    assert not known[int(hole[1]), int(hole[0])]
    assert 9 <= (~known[20:140, 20:140]).sum() <= 36
    assert not known[:, 158:].any()  # no raw pixel reaches there
    mapped = map_image(source, "equirectangular")
    grid = mapped.grid
    x_m, y_m = grid.projection.map_place(np.array(spot[0]), np.array(spot[1]))
    row, column = np.unravel_index(np.nanargmax(mapped.layers["image"]), grid.shape)
    assert abs(row + 0.5 - (grid.y0_m - y_m) / grid.step_m) <= 1
    assert abs(column + 0.5 - (x_m - grid.x0_m) / grid.step_m) <= 1


def test_coordinates_and_their_errors_are_those_of_the_cube_where_it_has_the_place(tmp_path) -> None:
    """Across 0/360 too: the cube's own planes (made pixel by pixel) at the pixel that shows each place of the map."""
    source = spot_product(tmp_path, looking_at(15.0, 0.0), [])
    mapped = map_image(source, "equirectangular", max_emission_deg=60)
    layers, grid = mapped.layers, mapped.grid
    shown = np.isfinite(layers["emission"])
    assert all(np.array_equal(np.isfinite(layers[name]), shown) for name in LAYERS if name != "image")
    latitude, longitude = grid.projection.latitude_longitude(*np.meshgrid(grid.x_m(), grid.y_m()))
    assert np.array_equal(layers["latitude"][shown], latitude[shown].astype(np.float32))
    assert np.array_equal(layers["longitude"][shown], longitude[shown].astype(np.float32))
    assert layers["longitude"][shown].min() < 10 < 350 < layers["longitude"][shown].max()
    assert (np.diff(layers["longitude"][grid.shape[0] // 2][shown[grid.shape[0] // 2]]) % 360 < 180).all()
    xy = pixels_of_points(source.pose, source.camera, surface_points(EUROPA, latitude[shown], longitude[shown]))
    x, y = np.rint(xy).astype(int).T
    step = np.degrees(grid.step_m / 1e3 / EUROPA.mean_radius_km)
    turn = (source.cube["longitude"].values[y, x] - layers["longitude"][shown] + 180) % 360 - 180
    assert np.abs(turn).max() < 3 * step
    for name in ("latitude_uncertainty", "longitude_uncertainty"):
        assert layers[name][shown] == pytest.approx(source.cube[name].values[y, x], rel=0.15)
    assert np.array_equal(layers["quality"][shown], source.cube["quality"].values[y, x].astype(np.float32))


def test_flags_are_those_of_the_nearest_pixel_also_of_a_cube_of_raw_pixels(tmp_path) -> None:
    pose = looking_at(20.0, 130.0)
    plain = small_publication("S", pose_after=pose).observation
    y, x = np.indices(plain.image.shape)
    places = np.stack([3.0 + 0.96 * x, 2.0 + 0.97 * y], axis=-1)
    quality = np.zeros(plain.image.shape, np.uint16)
    quality[60:100, 60:100] = Quality.SUSPECT
    sensor = SensorFrame(Observation(np.full_like(plain.image, 5), np.ones_like(plain.image), quality), places)
    publication = small_publication("S", pose_after=pose, observation=plain, sensor=sensor)
    write_cube(cube_dataset(publication), tmp_path / "cube.zarr")
    source = read_source(tmp_path)
    layers = map_image(source, "orthographic").layers
    shown = np.isfinite(layers["emission"])
    where = surface_points(EUROPA, layers["latitude"][shown], layers["longitude"][shown])
    column, row = ((pixels_of_points(pose, source.camera, where) - [3.0, 2.0]) / [0.96, 0.97]).T
    deep = (np.abs(column - 79.5) < 19) & (np.abs(row - 79.5) < 19)
    away = (np.abs(column - 79.5) > 22) | (np.abs(row - 79.5) > 22)
    flags = layers["quality"][shown].astype(int)
    assert (flags[deep] & int(Quality.SUSPECT)).all()
    assert not (flags[away] & int(Quality.SUSPECT)).any()


@pytest.mark.parametrize("form", ["geotiff", "cog"])
def test_gdal_reads_named_bands_with_units_flags_and_crs(tmp_path, form) -> None:
    import rasterio

    source = spot_product(tmp_path, looking_at(5.0, 359.0), [(0.0, 0.5)])
    mapped = map_image(source)
    path = write_geotiff(source, mapped, tmp_path / "m.tif", cloud_optimized=form == "cog")
    with rasterio.open(path) as file:
        assert file.descriptions == LAYERS
        units = dict(zip(LAYERS, file.units, strict=True))
        assert [name for name in LAYERS if units[name] != "degree"] == ["image", "quality"]
        assert np.isnan(file.nodata)
        assert "EUROPA" in file.crs.to_wkt().upper()
        for band, name in enumerate(LAYERS, start=1):
            assert np.array_equal(file.read(band), mapped.layers[name], equal_nan=True)
        meanings = file.tags(LAYERS.index("quality") + 1)
        assert len(meanings["flag_masks"].split()) == len(meanings["flag_meanings"].split()) == len(Quality)
        # The brightest pixel is where GDAL's own transformation has the spot that was planted, beyond the seam.
        row, column = np.unravel_index(np.nanargmax(file.read(1)), file.shape)
        x, y = file.xy(row, column)
        latitude, longitude = mapped.grid.projection.latitude_longitude(np.array(x), np.array(y))
        step = np.degrees(mapped.grid.step_m / 1e3 / EUROPA.mean_radius_km)
        assert abs(float(latitude)) < step
        assert abs((float(longitude) - 0.5 + 180) % 360 - 180) < step


def test_overviews_of_a_cog_average_no_flags_and_no_longitudes(tmp_path, monkeypatch) -> None:
    import rasterio

    monkeypatch.setattr("tasks.export.cog.BLOCK_PX", 128)  # the map is small
    source = spot_product(tmp_path, looking_at(5.0, 359.0), [(0.0, 0.5)])
    mapped = map_image(source, central_longitude_deg=180.0)
    path = write_geotiff(source, mapped, tmp_path / "m.tif", cloud_optimized=True)
    with rasterio.open(path, overview_level=0) as half:
        for name in ("quality", "longitude"):
            values = half.read(LAYERS.index(name) + 1)
            assert np.array_equal(values, mapped.layers[name][::2, ::2], equal_nan=True)
        assert not np.array_equal(half.read(1), mapped.layers["image"][::2, ::2], equal_nan=True)
