"""The product folder: what it holds, what it costs, and its picture."""

import json
import time

import numpy as np
import pytest
import xarray as xr
from PIL import Image
from scipy.spatial.transform import Rotation

from catalog.camera import Camera
from catalog.errors import RefusedError
from catalog.observation import Observation
from catalog.pose import Pose
from catalog.target import Target
from tasks.pictures.redraw import draw_planes
from tasks.project.curves import limb_points
from tasks.project.planes import project_planes
from tasks.project.uncertainty import PoseUncertainty
from tasks.publish import Publication, publish, redraw_overlay
from tasks.publish.framing import Box, box_of, close_up
from tasks.publish.overlay import CORRECTED, PREDICTED, TERMINATOR, draw_overlay, stretched

EUROPA = Target(name="europa", naif_id=502, radii_km=(1562.6, 1560.3, 1559.5), iau_crs="IAU_2015:50200")
SUN_KM = np.array([6e8, 1e8, -4e8])


def camera_of(size):
    return Camera(name="test", size_px=(size, size), centre_px=(size / 2, size / 2), focal_length_px=2e4)


def pose_of(radius_px, offset_km=(0.0, 0.0)):
    body = Rotation.from_euler("xz", [75, 20], degrees=True).as_matrix()
    return Pose(1.2e7, np.eye(3), np.array([*offset_km, 1560 * 2e4 / radius_px]), SUN_KM, body)


def publication_of(size=200, radius_px=70.0, offset_km=(300.0, -200.0), product="C0001", level=1000.0):
    camera, after = camera_of(size), pose_of(radius_px)
    lambert = np.cos(np.radians(project_planes(after, camera, EUROPA, planes=("incidence",)).incidence))
    noise = np.random.default_rng(2).normal(0, 5, (size, size))
    image = (level * np.clip(np.nan_to_num(lambert), 0, None) + noise).astype(np.float32)
    observation = Observation(image, np.full_like(image, 5), np.zeros(image.shape, np.uint16))
    uncertainty = PoseUncertainty.from_sigmas(
        {"offset_px": [0.1, 0.1], "range_factor": 1e-4, "attitude_deg": [0.1] * 3}
    )
    before = after.replaced(target_from_spacecraft_km=after.target_from_spacecraft_km + np.array([*offset_km, 0]))
    result = {
        "product": product,
        "status": "ok",
        "offset_px": [-3.1, 2.2],
        "range_factor": 0.99953,
        "limb_rms_px": 0.31,
    }
    return Publication(
        product, observation, camera, EUROPA, before, after, uncertainty, result, {"profile": "paper"}, {"image": "ab"}
    )


def test_a_product_holds_cube_picture_result_and_settings(tmp_path):
    folder = publish(publication_of(), tmp_path / "store")
    parts = ["SHA256SUMS", "cube.zarr", "overlay.png", "result.json", "settings.json"]
    assert sorted(p.name for p in folder.iterdir()) == parts
    result = json.loads((folder / "result.json").read_text())
    assert (result["status"], result["cube"], result["overlay"]) == ("ok", "cube.zarr", "overlay.png")
    assert json.loads((folder / "settings.json").read_text()) == {"profile": "paper"}
    assert [p.name for p in (tmp_path / "store").iterdir()] == ["C0001"]


def test_a_result_that_is_no_json_leaves_nothing_in_the_store(tmp_path):
    publication = publication_of()
    publication.result["limb_rms_px"] = float("nan")
    with pytest.raises(ValueError, match="JSON"):
        publish(publication, tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_cube_that_was_opened_before_an_overwrite_never_reads_as_missing(tmp_path):
    publish(publication_of(level=1000.0), tmp_path)
    opened = xr.open_zarr(tmp_path / "C0001" / "cube.zarr")
    publish(publication_of(level=3000.0), tmp_path)
    assert float(opened["image"].max()) > 2000
    assert np.isfinite(opened["image"].values).all()
    assert np.isfinite(opened["latitude"].values).any()


def test_size_and_time_of_a_full_frame_product(tmp_path):
    """A disk of 900 px on 1024x1024; the image is noise-limited, which is what costs most."""
    publication = publication_of(size=1024, radius_px=450.0)
    publish(publication, tmp_path / "warm")
    started = time.perf_counter()
    folder = publish(publication, tmp_path / "store")
    seconds = time.perf_counter() - started
    cube = folder / "cube.zarr"
    stored = sum(p.stat().st_size for p in cube.rglob("*") if p.is_file())
    started = time.perf_counter()
    with xr.open_zarr(cube) as opened:
        open_s = time.perf_counter() - started
        raw = sum(v.nbytes for v in opened.variables.values())
    picture = (folder / "overlay.png").stat().st_size
    print(
        f"raw {raw / 1e6:.1f} MB, stored {stored / 1e6:.1f} MB ({100 * stored / raw:.0f} %), "
        f"overlay {picture / 1e3:.0f} kB, written in {seconds:.2f} s, opened in {open_s * 1e3:.0f} ms"
    )
    assert stored < 0.6 * raw
    assert picture < 1e6


def colour_at(path, style):
    """How many pixels of a picture have about a style's colour."""
    wanted = np.array([int(style["color"][i : i + 2], 16) for i in (1, 3, 5)])
    with Image.open(path) as picture:
        pixels = np.asarray(picture.convert("RGB"), dtype=int)
    return int((np.abs(pixels - wanted).max(axis=2) < 40).sum())


def test_the_picture_shows_both_limbs_and_the_terminator(tmp_path):
    p = publication_of()
    path = draw_overlay(p.observation.image, p.pose_before, p.pose_after, p.camera, EUROPA, tmp_path / "o.png", "title")
    for style in (PREDICTED, CORRECTED, TERMINATOR):
        assert colour_at(path, style) > 300, style
    with Image.open(path) as picture:
        assert 700 < picture.width < 1200


def test_a_predicted_limb_far_away_gets_a_second_panel(tmp_path):
    near, far = (publication_of(offset_km=(d, 0.0)) for d in (100.0, 9000.0))
    widths = []
    for name, p in (("near", near), ("far", far)):
        path = draw_overlay(
            p.observation.image, p.pose_before, p.pose_after, p.camera, EUROPA, tmp_path / f"{name}.png"
        )
        with Image.open(path) as picture:
            widths.append(picture.width)
        assert colour_at(path, PREDICTED) > 100
    assert widths[1] > 1.5 * widths[0]


def test_a_picture_is_drawn_even_when_one_pose_looks_away(tmp_path):
    p = publication_of()
    away = p.pose_before.replaced(target_from_spacecraft_km=-p.pose_before.target_from_spacecraft_km)
    for before, after in ((away, p.pose_after), (p.pose_after, away), (away, away)):
        path = draw_overlay(p.observation.image, before, after, p.camera, EUROPA, tmp_path / "o.png")
        assert path.stat().st_size > 5000


def test_a_picture_is_drawn_again_from_the_cube_alone(tmp_path):
    folder = publish(publication_of(), tmp_path)
    before = (folder / "overlay.png").read_bytes()
    (folder / "overlay.png").unlink()
    assert redraw_overlay(folder).read_bytes() == before


def test_a_store_in_place_of_a_product_is_refused_naming_the_first_of_its_products(tmp_path):
    with pytest.raises(RefusedError, match=r"holds no cube\.zarr\. Give a product folder"):
        redraw_overlay(tmp_path)
    for number in range(7):
        (tmp_path / f"C{number}" / "cube.zarr").mkdir(parents=True)
    (tmp_path / ".hidden" / "cube.zarr").mkdir(parents=True)
    for draw in (redraw_overlay, draw_planes):
        with pytest.raises(RefusedError, match=r"the products C0, C1, C2, C3, C4 \.\.\. \(7 in all\)") as refusal:
            draw(tmp_path)
        assert refusal.value.remedy == f"Give one of them: {tmp_path / 'C0'}."


def test_the_close_up_holds_the_whole_disk_and_both_limbs_when_near():
    camera, frame = camera_of(400), Box(-0.5, -0.5, 399.5, 399.5)
    before, after = (box_of(limb_points(pose_of(70.0, shift), camera, EUROPA)) for shift in ((500.0, 0.0), (0.0, 0.0)))
    box, far_apart = close_up(before, after, frame)
    assert not far_apart
    assert box.x0 < after.x0 < before.x0
    assert box.x1 > before.x1 > after.x1
    assert close_up(None, after, frame)[1]
    assert close_up(None, None, frame) == (frame, False)


def test_the_stretch_keeps_dark_parts_visible_and_survives_gaps():
    image = np.linspace(0, 1000, 10000, dtype=np.float32).reshape(100, 100)
    image[0, 0] = np.nan
    shown = stretched(image)
    assert shown.min() == 0
    assert shown.max() == 1
    assert shown[20, 50] > 0.25
    assert (stretched(np.full((5, 5), np.nan, np.float32)) == 0).all()
