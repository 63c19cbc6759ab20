"""The paper's 57 images, simulated: what is written can be read, is wrong as planted, and true where it says so."""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from catalog.camera import Camera, find_camera
from catalog.errors import RefusedError
from catalog.pose import read_pose_file
from catalog.readers import read_frame
from catalog.target import find_target
from lab.evaluate.assess import assess
from lab.simulate.archive import MANIFEST, Files, read_manifest, simulate_europa57
from lab.simulate.europa57 import paper_images
from lab.simulate.synthesis import Synthetic
from tasks.project.curves import limb

PRODUCTS = ("C2053031", "LOR_0034732619")
EUROPA = find_target("europa")
SEED = 3
STEPS_PX = np.arange(-4, 4.01, 0.25)


@dataclass
class Archive:
    folder: Path
    files: dict[str, Files]
    made: dict[str, Synthetic]


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Archive:
    folder, made = tmp_path_factory.mktemp("europa57"), {}

    def keep(image: Synthetic) -> None:
        made[image.image.product] = image

    written = simulate_europa57(folder, SEED, PRODUCTS, tell=keep)
    return Archive(folder, {files.image.stem: files for files in written}, made)


def camera_of(product: str) -> Camera:
    return find_camera(paper_images()[product].camera)


def test_files_are_read_as_the_cameras_own_with_a_whole_list_beside_them(archive: Archive) -> None:
    rows = {row["product"]: row for row in read_manifest(archive.folder / MANIFEST)}
    assert set(rows) == set(PRODUCTS)
    for product, row in rows.items():
        frame = read_frame(archive.folder / row["image"])
        assert (frame.camera, frame.target) == (row["camera"], "europa")
        np.testing.assert_array_equal(frame.observation.image, archive.made[product].recorded.image)
        assert all((archive.folder / row[key]).is_file() for key in ("pose_file", "truth_file", "truth.facts"))


@pytest.mark.parametrize("product", PRODUCTS)
def test_the_pose_file_is_wrong_by_what_the_facts_say_and_the_truth_is_the_papers(
    archive: Archive, product: str
) -> None:
    files = archive.files[product]
    facts = json.loads(files.facts.read_text())
    predicted, truth = (read_pose_file(path).completed() for path in (files.predicted, files.truth))
    error = assess(predicted, truth, camera_of(product), EUROPA)
    np.testing.assert_allclose(error.centre_px, -np.array(facts["planted"]["offset_px"]), atol=1e-6)
    assert 1 / (1 + error.range_error) == pytest.approx(facts["planted"]["range_factor"], rel=1e-9)
    turned = predicted.replaced(
        camera_from_j2000=truth.camera_from_j2000, target_from_spacecraft_km=truth.target_from_spacecraft_km
    )
    planted_deg = float(np.linalg.norm(facts["planted"]["attitude_deg"]))
    angle = assess(turned, truth, camera_of(product), EUROPA)
    assert angle.attitude_error_deg == pytest.approx(planted_deg, abs=1e-6)
    assert np.hypot(angle.about_sight_deg, angle.across_sight_deg) == pytest.approx(planted_deg, abs=1e-6)
    assert truth.to_dict() == paper_images()[product].pose.to_dict()
    assert facts["surface"]["law"] in ("hapke", "minnaert", "lommel-seeliger")
    assert abs(facts["psf"]["factor"] - 1) == pytest.approx(0.2)


def test_the_same_seed_gives_the_same_file_whatever_else_is_made_and_another_seed_another(
    archive: Archive, tmp_path: Path
) -> None:
    product = PRODUCTS[1]
    (again,) = simulate_europa57(tmp_path / "again", SEED, [product])
    assert again.image.read_bytes() == archive.files[product].image.read_bytes()
    assert again.facts.read_text() == archive.files[product].facts.read_text()
    (other,) = simulate_europa57(tmp_path / "other", SEED + 1, [product])
    assert other.predicted.read_text() != again.predicted.read_text()


@pytest.mark.parametrize("product", PRODUCTS)
def test_the_true_limb_lies_on_the_raw_images_edge(archive: Archive, product: str) -> None:
    """Through the true distortion: where the brightness falls along each normal of the bright limb."""
    made = archive.made[product]
    camera, pose = made.image.camera, made.image.pose
    curve = limb(pose, camera, EUROPA, n=90)
    sun = pose.camera_from_body @ pose.sun_direction_in_body
    outward = curve.xy_px - camera.project(pose.target_in_camera_km)
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    bright = outward @ (sun[:2] / np.linalg.norm(sun[:2])) > 0.5
    places = curve.xy_px[bright][:, None] + outward[bright][:, None] * STEPS_PX[:, None]
    window = made.picture.window
    ideal = _edge(made.picture.brightness, places - (window.x0, window.y0))
    start = places * (np.array(camera.detector_size_px) - 1) / (np.array(camera.size_px) - 1)
    apart = _edge(made.recorded.image, made.optics.distort_points(places, start)) - ideal
    print(f"{product}: edge minus limb {np.median(ideal):+.3f} px, raw minus ideal {np.median(apart):+.3f} px")
    assert abs(np.median(ideal)) < 0.5  # a surface that is bright at the very limb looks larger by a part of the blur
    assert abs(np.median(apart)) < 0.1
    assert apart.std() < 0.3


def _edge(image: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Mean place (n,), px, of the fall of `image` along `places` (n, k, 2), which are `STEPS_PX` from the limb."""
    from scipy.ndimage import map_coordinates

    profile = map_coordinates(image, np.moveaxis(places[..., ::-1], -1, 0), order=1)
    fall = np.maximum(-np.diff(profile, axis=1), 0)
    return (fall * (STEPS_PX[1:] + STEPS_PX[:-1]) / 2).sum(axis=1) / fall.sum(axis=1)


def test_a_matched_image_has_the_corrections_psf_and_map_and_a_clean_detector(tmp_path: Path) -> None:
    (files,) = simulate_europa57(tmp_path, SEED, ["C2053031"], matched=True)
    facts = json.loads(files.facts.read_text())
    assert facts["psf"]["factor"] == 1
    assert (facts["surface"]["law"], facts["surface"]["map"]) == ("mixture", EUROPA.basemap)
    assert facts["optics"]["kind"] == "nominal (thin-plate)"
    assert (facts["detector"]["spikes"], facts["detector"]["missing_lines"]) == (0, [])


def test_nothing_to_simulate_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RefusedError, match="no image of europa57"):
        simulate_europa57(tmp_path, SEED, ["C0000000"])
