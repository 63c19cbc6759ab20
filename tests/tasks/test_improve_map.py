"""Improved maps: planted turns of maps are found and taken out, an image is matched with the others' map, the new map
is read back with the place of every pixel."""

import json
from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner

from catalog.basemap import BaseMap, read_map
from catalog.errors import FailedError, WrongOptionError
from catalog.pose import read_pose_file
from catalog.rotation import rotation_from_vector_deg
from catalog.target import find_target
from flows.cli import build_app
from lab.maps.network import rms_across_deg
from lab.simulate.albedo_store import paper_views, write_albedo_store
from tasks.control.settings import ControlSettings
from tasks.geometry.bilinear import map_values
from tasks.improve.filled import filled, levelled
from tasks.improve.frame import Feature, feature_of, mean_turn_deg, turn_between, turn_to_features, turned_back
from tasks.improve.map_patches import GroundMap
from tasks.improve.settings import ImproveSettings
from tasks.improve.sums import Sums
from tasks.project.points import latitude_longitude, surface_points

EUROPA = find_target("europa")
PATCHES = ControlSettings(points=300, least_correlation=0.7)
VIEWS = ("LOR_0034823099", "LOR_0034849319", "LOR_0034866659", "C1634216", "C1632318", "C2062524")


def textured(seed: int = 3, shape: tuple[int, int] = (360, 720)) -> BaseMap:
    import cv2

    rng = np.random.default_rng(seed)
    field = sum(cv2.GaussianBlur(rng.standard_normal(shape), (0, 0), s) * s for s in (2, 6))
    return BaseMap("textured", (1 + 0.15 * field / field.std()).clip(0.2).astype(np.float32), 0.0, "planted")


def turned_map(albedo: BaseMap, turn_deg) -> BaseMap:
    """What a map becomes whose ground is turned."""
    rows, columns = albedo.albedo.shape
    latitude, longitude = np.meshgrid(
        90 - (np.arange(rows) + 0.5) * 180 / rows, (np.arange(columns) + 0.5) * 360 / columns, indexing="ij"
    )
    before = surface_points(EUROPA, latitude, longitude) @ rotation_from_vector_deg(np.asarray(turn_deg))
    values = map_values(albedo.albedo, 0.0, *latitude_longitude(before))
    return BaseMap("turned", values.astype(np.float32), 0.0, "planted")


def ground(albedo: BaseMap) -> GroundMap:
    km = float(np.radians(360 / albedo.albedo.shape[1]) * EUROPA.mean_radius_km)
    return GroundMap(albedo.albedo, np.full(albedo.albedo.shape, km, np.float32), albedo.left_edge_deg, km)


def test_the_turn_between_two_maps_is_found() -> None:
    old, planted = textured(), np.array([0.3, -0.2, 0.5])
    found = turn_between(ground(turned_map(old, planted)), ground(old), EUROPA, PATCHES)
    assert np.abs(found.turn_deg - planted).max() < max(4 * found.sigma_deg, 0.01)
    assert found.sigma_deg < 0.01
    assert found.places > 100


def test_two_maps_with_nothing_in_common_hold_no_frame() -> None:
    with pytest.raises(FailedError, match="--hold-frame rotation"):
        turn_between(ground(textured(4)), ground(textured(5)), EUROPA, PATCHES)


def test_a_feature_holds_the_longitude_where_it_is_defined() -> None:
    old = textured()
    new = ground(turned_map(old, [0.0, 0.0, 0.4]))
    shown = Feature("spot", (10.0, 100.0), (10.0, 100.0))
    assert turn_to_features(new, ground(old), EUROPA, [shown], PATCHES) == pytest.approx(0.4, abs=0.03)
    elsewhere = feature_of("spot:10,100.25@10,100")
    assert turn_to_features(new, ground(old), EUROPA, [elsewhere], PATCHES) == pytest.approx(0.15, abs=0.03)


@pytest.mark.parametrize("text", ["spot", "spot:1", "spot:95,3", ":1,2", "spot:1,2@3", "spot:1,e"])
def test_a_feature_that_is_none_is_refused(text: str) -> None:
    with pytest.raises(WrongOptionError, match="NAME:LAT,LON"):
        feature_of(text)


def test_poses_turned_together_are_turned_back() -> None:
    poses = [view.pose for view in paper_views()[::8]]
    turn = np.array([0.2, -0.1, 0.3])
    turned = [turned_back(pose, -turn) for pose in poses]
    assert mean_turn_deg(turned, poses) == pytest.approx(turn, abs=1e-3)
    for pose, there in zip(poses, turned, strict=True):
        again = turned_back(there, turn)
        assert again.body_from_j2000 == pytest.approx(pose.body_from_j2000, abs=1e-12)


def test_a_frame_or_projection_that_is_none_is_refused() -> None:
    with pytest.raises(WrongOptionError, match="rotation"):
        ImproveSettings(hold_frame="stars")
    with pytest.raises(WrongOptionError, match="--feature"):
        ImproveSettings(hold_frame="feature")
    with pytest.raises(WrongOptionError, match="equirectangular"):
        ImproveSettings(mosaic=replace(ImproveSettings().mosaic, projection="orthographic"))


def test_the_old_map_fills_what_no_image_shows_at_the_level_of_the_rest() -> None:
    rng = np.random.default_rng(1)
    old = rng.uniform(0.5, 1.5, (18, 36)).astype(np.float32)
    sums = Sums.empty((18, 36))
    sums.weight[:, :20] = 4.0
    sums.value[:, :20] = 4.0 * (200 * old + 50)[:, :20]
    latitude = 85 - 10 * np.arange(18.0)
    level = levelled(old, sums.reflectance, latitude)
    assert level == pytest.approx(200 * old + 50, rel=1e-4)
    assert filled(sums, level, 0.02) == pytest.approx(200 * old + 50, rel=1e-4)


@pytest.fixture(scope="module")
def improved(tmp_path_factory):
    """The command on a small store of known truth, whose map is the old one."""
    folder = tmp_path_factory.mktemp("improve")
    chosen = [view for view in paper_views() if view.product in VIEWS]
    albedo = textured(7, (512, 1024))
    stated = {"offset_px": [0.03, 0.03], "range_factor": 1e-4, "roll_deg": 0.01, "attitude_deg": [0.1] * 3}
    write_albedo_store(
        folder / "store", chosen, albedo, noise=0.004, attitude_error_deg=0.1, stated=stated, subpixels_across=250
    )
    from PIL import Image

    Image.fromarray((100 * albedo.albedo).astype(np.uint8)).save(folder / "old.png")
    out = folder / "new.tif"
    given = ["--map", str(folder / "old.png"), "--resolution", "2ppd", "--rounds", "2", "--points", "700"]
    answer = CliRunner().invoke(build_app(), ["improve-map", str(folder / "store"), "--out", str(out), *given])
    assert answer.exit_code == 0, answer.output
    return (
        folder,
        {view.product: view for view in chosen},
        json.loads((folder / "new" / "improve-map.json").read_text()),
        albedo,
    )


def test_planted_errors_of_orientations_fall(improved) -> None:
    folder, views, report, _ = improved
    after = {product: read_pose_file(folder / "new" / f"{product}.pose.json").completed() for product in views}
    truth = [view.pose for view in views.values()]
    assert {row["product"] for row in report["rows"]} == set(views)
    assert rms_across_deg(list(after.values()), truth) < 0.05
    assert report["moves_in_sigmas"][0] > 3 * report["moves_in_sigmas"][1]
    sigma = np.array([row["sigma_after_deg"] for row in report["rows"]])
    assert (sigma > 0.005).all()
    assert (sigma <= [row["sigma_before_deg"] for row in report["rows"]]).all()


def test_the_new_map_is_read_as_a_base_map_and_shows_the_ground_where_it_is(improved) -> None:
    import rasterio

    folder, _, report, albedo = improved
    new = read_map(folder / "new.tif")
    assert new.albedo.shape == (360, 720)
    turn = turn_between(ground(new), ground(albedo), EUROPA, PATCHES)
    assert np.abs(turn.turn_deg).max() < 0.03
    assert np.abs(report["turn_against_old_map_deg"]).max() < 0.03
    with rasterio.open(folder / "new.tif") as file:
        assert file.crs.is_geographic
        assert file.transform.c == pytest.approx(0.0, abs=1e-9)
        assert file.bounds.top == pytest.approx(90.0)
        assert file.tags()["POSITIVE_LONGITUDE_DIRECTION"] == "east"
        assert file.tags()["AREA_OR_POINT"] == "Area"
    with rasterio.open(folder / "new" / "layers.tif") as file:
        assert file.descriptions == ("reflectance", "sigma", "count", "resolution_km")
        assert np.nanmax(file.read(3)) > 3
