"""The camera's error and the target's, apart: each pixel sees what it saw, covariances are those of chance, plain SPICE
says the same, and planted offsets come back."""

import csv
import json
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import ades
import numpy as np
import pytest
import spiceypy
from astropy.table import Table
from lxml import etree

import planetpose
from catalog.camera import Camera, find_camera
from catalog.celestial import orientation_of_twist
from catalog.errors import RefusedError, WrongOptionError
from catalog.pose import Pose
from catalog.rotation import rotation_from_vector_deg, vector_deg_from_rotation
from catalog.spice import kernel_pool
from catalog.stars.table import ra_dec_deg
from catalog.target import find_target
from flows.prediction import refuse_company
from flows.request import Request
from lab.stars.separation import Planted, write_separation_scene
from lab.stars.separation_run import cases, compared, separation_summary
from tasks.astrometry.ades import perm_id
from tasks.astrometry.observation import ARCSEC
from tasks.astrometry.store import write_astrometry
from tasks.kernels.exposure import Exposure, without_aberration
from tasks.kernels.write import write_kernel_set
from tasks.point.rotation import pose_moved_by
from tasks.priors import PriorSettings
from tasks.stars.separate import LEAST_ROLL_DEG, StarOrientation, offset_covariance_km2, separation

CAMERA = Camera(name="c", size_px=(400, 300), centre_px=(199.5, 149.5), focal_length_px=20_000)
MOVING = {"spacecraft_velocity_km_s": (5.0, -12.0, -3.0), "target_velocity_km_s": (-8.0, 9.0, 4.0)}
TRUTH = rotation_from_vector_deg([30.0, -70.0, 120.0])
STARS = StarOrientation(TRUTH, np.diag([3e-5, 4e-5, 3e-3]) ** 2)


def metadata(offset_km: tuple[float, float, float]) -> tuple[Pose, Pose]:
    """The true pose, and the predicted one: its camera off, and its target by as much."""
    centre = TRUTH.T @ CAMERA.ray([260.0, 90.0]) * 9e5
    pose = Pose(1e8, TRUTH, centre, np.array([5e8, 4e8, -2e8]), rotation_from_vector_deg([10, 20, 30]), **MOVING)
    off = rotation_from_vector_deg([0.03, -0.02, 0.08]) @ TRUTH
    return pose, pose.replaced(camera_from_j2000=off, target_from_spacecraft_km=centre - np.array(offset_km))


def corrected(truth: Pose, predicted: Pose) -> Pose:
    """What the steps come to without stars: the predicted camera moved until the target is where it is seen."""
    started = STARS.predicted(predicted)
    off = CAMERA.project(truth.target_in_camera_km) - CAMERA.project(started.target_in_camera_km)
    moved = pose_moved_by(started, CAMERA, off).with_range_factor(truth.range_km / started.range_km)
    turned = rotation_from_vector_deg([0.0, 0.02, -0.05])
    return moved.replaced(body_from_j2000=turned @ moved.body_from_j2000)


def test_with_the_stars_camera_each_pixel_sees_what_it_saw() -> None:
    truth, predicted = metadata((20.0, -30.0, 10.0))
    before = corrected(truth, predicted)
    after = STARS.separated(before, STARS.predicted(predicted))
    assert np.array_equal(after.camera_from_j2000, TRUTH)
    assert after.target_in_camera_km == pytest.approx(before.target_in_camera_km, rel=1e-12)
    assert after.camera_from_body == pytest.approx(before.camera_from_body, abs=1e-12)
    assert after.target_from_spacecraft_km == pytest.approx(truth.target_from_spacecraft_km, abs=0.2)


def test_a_body_that_was_not_turned_stays_in_j2000() -> None:
    truth, predicted = metadata((20.0, -30.0, 10.0))
    started = STARS.predicted(predicted)
    after = STARS.separated(pose_moved_by(started, CAMERA, (3.0, 4.0)), started)
    assert np.array_equal(after.body_from_j2000, truth.body_from_j2000)


@pytest.mark.parametrize("offset_km", [(1.0, 0.0, 0.0), (-10.0, 20.0, 5.0), (30.0, 10.0, -38.0)])
def test_offsets_are_stated_apart(offset_km: tuple[float, float, float]) -> None:
    truth, predicted = metadata(offset_km)
    started = STARS.predicted(predicted)
    after = STARS.separated(corrected(truth, predicted), started)
    found = separation(STARS, predicted, started, after, CAMERA, {"offset_px": [0.02, 0.03], "range_factor": 1e-5})
    assert found["target_offset_km"] == pytest.approx(offset_km, abs=0.2)
    shift = CAMERA.project(truth.target_in_camera_km) - CAMERA.project(started.target_in_camera_km)
    assert found["target_offset_px"] == pytest.approx(shift, abs=1e-6)
    predicted_boresight = CAMERA.project(TRUTH @ predicted.camera_from_j2000[2]) - CAMERA.centre_px
    assert found["camera_offset_px"] == pytest.approx(predicted_boresight)
    assert np.hypot(*found["camera_offset_px"]) == pytest.approx(np.radians(np.hypot(0.03, 0.02)) * 20_000, rel=1e-3)
    assert found["camera_roll_deg"] == pytest.approx(-0.08, abs=1e-4)
    unknown = separation(STARS, predicted, started, after, CAMERA, {"offset_px": None})
    assert unknown["target_offset_covariance_km2"] is None
    assert unknown["target_offset_sigma_px"] == [None, None]


def test_the_covariance_is_that_of_drawn_errors() -> None:
    truth, _ = metadata((0.0, 0.0, 0.0))
    sigma = {"offset_px": [0.05, 0.02], "range_factor": 2e-5}
    random, drawn = np.random.default_rng(1), []
    for _ in range(4000):
        turn = rotation_from_vector_deg(random.normal(0, np.sqrt(np.diag(STARS.covariance_deg2))))
        place = CAMERA.project(truth.target_in_camera_km) + random.normal(0, sigma["offset_px"])
        distance = truth.range_km * (1 + random.normal(0, 2e-5))
        drawn.append((turn @ TRUTH).T @ CAMERA.ray(place) * distance - truth.target_from_spacecraft_km)
    stated = offset_covariance_km2(STARS, truth, CAMERA, sigma)
    assert stated is not None
    root = np.linalg.inv(np.linalg.cholesky(stated))
    assert np.cov((np.array(drawn) @ root.T).T) == pytest.approx(np.eye(3), abs=0.08)


def test_the_roll_is_held_by_the_stars_but_never_exactly() -> None:
    assert STARS.priors(PriorSettings()).roll_deg == pytest.approx(3e-3)
    exact = StarOrientation(TRUTH, np.eye(3) * 1e-14)
    assert exact.priors(PriorSettings()).roll_deg == LEAST_ROLL_DEG


def test_plain_spice_has_the_camera_and_the_target_as_the_stars_have_them(tmp_path: Path) -> None:
    truth, predicted = metadata((20.0, -30.0, 10.0))
    after = STARS.separated(corrected(truth, predicted), STARS.predicted(predicted))
    exposure = Exposure("p", find_camera("cassini-nac"), find_target("enceladus"), after, 0.5)
    with kernel_pool([]) as loaded:
        kernel_set = write_kernel_set("p", [exposure], tmp_path, loaded)
    names = kernel_set.names_of(exposure)
    with kernel_pool([kernel_set.meta_kernels["alone"]]):
        turned = np.asarray(spiceypy.pxform("J2000", names["camera_frame"], after.et))
        seen, _ = spiceypy.spkpos(names["target"], after.et, "J2000", "LT+S", names["spacecraft"])
    assert np.abs(vector_deg_from_rotation(turned @ TRUTH.T)).max() < 2e-5
    along, there = np.asarray(seen) / np.linalg.norm(seen), truth.target_from_spacecraft_km / truth.range_km
    assert np.degrees(np.linalg.norm(along - there)) < 2e-5
    assert np.asarray(seen) - predicted.target_from_spacecraft_km == pytest.approx([20.0, -30.0, 10.0], abs=0.3)


@dataclass(frozen=True)
class AmongStars:
    """A planted scene, its result and the store that it was published in."""

    planted: Planted
    result: dict[str, Any]
    store: Path


@pytest.fixture(scope="module")
def among_stars(tmp_path_factory: pytest.TempPathFactory) -> AmongStars:
    folder = tmp_path_factory.mktemp("among-stars")
    planted = write_separation_scene(folder, seed=3)
    files = planted.files
    result = planetpose.correct(
        files["image"], folder / "out", camera=files["camera"], target="europa", pose_file=files["pose"],
        kernels=[], stars=files["catalog"], cache=folder / "cache",
    )  # fmt: skip
    return AmongStars(planted, dict(result), folder / "out")


def test_planted_offsets_of_camera_and_target_come_back_apart(among_stars: AmongStars) -> None:
    planted, result = among_stars.planted, among_stars.result
    found = result["stars"]
    assert result["status"] == "ok", result["reason"]
    assert found["stars"] >= 8
    turned = np.array(result["pose"]["camera_from_j2000"]) @ planted.pose.camera_from_j2000.T
    focal_px = planted.camera.focal_length_px
    assert np.radians(np.hypot(*vector_deg_from_rotation(turned)[:2])) * focal_px < 0.1
    error = planted.pose.camera_from_j2000 @ (np.array(found["target_offset_km"]) - planted.offset_km)
    assert np.hypot(*error[:2]) / planted.pose.range_km * focal_px < 0.1
    assert max(found["target_offset_sigma_px"]) < 0.1


def test_the_benchmark_compares_with_the_truth_and_with_plain_spice(among_stars: AmongStars, tmp_path: Path) -> None:
    result = among_stars.result | {"stars": dict(among_stars.result["stars"])}
    row = {"status": "ok", **compared(result, among_stars.planted, tmp_path)}
    assert row["error_px"] < 0.1
    assert row["kernels_deg"] < 1e-9
    assert max(map(abs, row["z"])) < 4
    turned = among_stars.planted.pose.camera_from_j2000.T @ [1.0, 0.0, 0.0]
    result["stars"]["target_offset_km"] = list(result["stars"]["target_offset_km"] + 200.0 * turned)
    wrong = {"status": "ok", **compared(result, among_stars.planted, tmp_path)}
    figures = separation_summary([row, wrong, {"status": "failed", "error_px": None}])
    assert (figures["frames"], figures["ok"], figures["wrong_ok"], figures["beyond_bar"]) == (3, 2, 1, 1)
    assert len({case.like.name for case in cases(12, 7)}) == 12


def test_the_overlay_marks_the_stars_and_the_index_has_the_targets_offset(among_stars: AmongStars) -> None:
    from PIL import Image

    from tasks.publish.index import open_index

    found = among_stars.result["stars"]
    known = {(each["x_px"], each["y_px"]) for each in found["matches"]}
    assert not known & {(each["x_px"], each["y_px"]) for each in found["unidentified"]}
    with Image.open(among_stars.store / "stars/overlay.png") as picture:
        drawn = np.asarray(picture.convert("RGB"), int)
    assert drawn.shape[1] > 1200  # the whole frame beside the target
    assert (np.abs(drawn - [0x00, 0x9E, 0x73]).max(axis=-1) < 12).sum() > 20 * len(known)
    row = open_index(among_stars.store).iloc[0]
    assert row["stars"] == found["stars"]
    assert [row["target_offset_x_px"], row["target_offset_y_px"]] == pytest.approx(found["target_offset_px"])


def test_the_tables_of_astrometry_hold_the_true_direction_and_are_valid(
    among_stars: AmongStars, tmp_path: Path
) -> None:
    truth = among_stars.planted.pose
    rows, left_out, paths = write_astrometry(among_stars.store, tmp_path / "out", [])
    assert (left_out, len(rows)) == ({}, 1)
    (row,) = rows
    ra, dec = ra_dec_deg(truth.target_from_spacecraft_km)
    error = np.array([(row["ra_deg"] - ra) * np.cos(np.radians(dec)), row["dec_deg"] - dec]) * 3600  # type: ignore[operator]
    sigma = np.array([row["sigma_ra_arcsec"], row["sigma_dec_arcsec"]], dtype=float)
    assert (np.abs(error) < 4 * sigma).all()
    assert sigma.max() < 0.1 / among_stars.planted.camera.focal_length_px * ARCSEC
    assert row["computed_from"] == "product"
    assert row["oc_sample_px"] == pytest.approx(among_stars.result["stars"]["target_offset_px"][0], abs=1e-6)
    still = ra_dec_deg(without_aberration(truth.target_from_spacecraft_km, truth.spacecraft_velocity_km_s))
    assert row["ra_astrometric_deg"] == pytest.approx(float(still[0]), abs=1e-3)
    turned = orientation_of_twist(row["ra_c_deg"], row["dec_c_deg"], row["twist_deg"])  # type: ignore[arg-type]
    assert turned == pytest.approx(np.array(among_stars.result["pose"]["camera_from_j2000"]), abs=1e-9)
    votable = Table.read(tmp_path / "out/astrometry.vot", format="votable")
    assert votable["ra_deg"][0] == row["ra_deg"]
    assert str(votable["oc_ra_arcsec"].unit) == "arcsec"
    with (tmp_path / "out/stars.csv").open() as file:
        assert len(list(csv.DictReader(file))) == len(among_stars.result["stars"]["matches"])
    document = etree.parse(str(tmp_path / "out/astrometry.ades.xml"))
    for name in ("general", "submit"):
        schema = etree.XMLSchema(etree.parse(str(Path(ades.__file__).parent / f"data/xsd/{name}.xsd")))
        assert schema.validate(document), schema.error_log
    tables = ["astrometry.csv", "astrometry.vot", "astrometry.ades.xml", "stars.csv"]
    assert [path.name for path in paths] == [*tables, "astrometry.png"]
    assert (tmp_path / "out/astrometry.png").stat().st_size > 10_000


def test_images_without_stars_are_left_out_of_astrometry(among_stars: AmongStars, tmp_path: Path) -> None:
    shutil.copytree(among_stars.store / "stars", tmp_path / "store/plain")
    path = tmp_path / "store/plain/result.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"stars": {"stars": 0, "reason": "none looked for"}}))
    with pytest.raises(RefusedError, match="holds no image with stars"):
        write_astrometry(tmp_path / "store", tmp_path / "out", [])
    shutil.copytree(among_stars.store / "stars", tmp_path / "store/good")
    rows, left_out, _ = write_astrometry(tmp_path / "store", tmp_path / "out", [])
    assert len(rows) == 1
    assert left_out["plain"].startswith("stars-not-identified: ")


@pytest.mark.parametrize(
    ("naif_id", "name"), [(502, "Jupiter 2"), (602, "Saturn 2"), (2000433, "433"), (399, None), (599, None)]
)
def test_bodies_have_the_designations_of_the_minor_planet_center(naif_id: int, name: str | None) -> None:
    assert perm_id(naif_id) == name


@pytest.mark.parametrize(("option", "more"), [("stars", {"stars": "gaia"}), ("body", {"body": ("io",)})])
def test_stars_and_bodies_are_refused_with_a_pose_found_in_the_image(
    tmp_path: Path, option: str, more: dict[str, Any]
) -> None:
    request = Request(image=tmp_path / "a.img", store=tmp_path, product="a", pose_file=Path("image"), **more)
    with pytest.raises(WrongOptionError, match=f"--{option} needs a predicted pose") as refused:
        refuse_company(request)
    assert refused.value.option == option
    refuse_company(request.model_copy(update={"stars": None, "body": ("none",)}))
