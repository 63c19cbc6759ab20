"""What the page shows beside the planes: failed images, layers, neighbours, runs; and the page in a notebook."""

import json
import re
from pathlib import Path
from urllib.request import urlopen

import numpy as np
import pandas as pd
import pytest
from client import client_of
from small_product import camera_of, pose_of, small_publication

from catalog.basemap import map_of_target
from catalog.body import Ring
from catalog.errors import RefusedError
from catalog.observation import Observation
from catalog.placed_body import PlacedBody
from catalog.rotation import rotation_from_vector_deg
from catalog.target import find_target
from flows.flow_run import current_run
from lab.simulate.independent import independent_image
from tasks.diagnose.failed_folder import FRAME, failed_folder, frame_dataset, note_result
from tasks.guidance.prefect_run import note_run, noted_run
from tasks.pictures.flow_vectors import flow_vectors
from tasks.pictures.planes_figure import planes_figure
from tasks.pictures.product import Product
from tasks.pictures.thumbnail import write_thumbnail
from tasks.position.model import read_position_model
from tasks.position.position import positions_of_pixels
from tasks.publish import publish
from tasks.publish.cube import write_group
from tasks.simulate import Scene
from tasks.validate import ValidateSettings
from viewer.export import export_store
from viewer.notebook import view
from viewer.planes import Planes
from viewer.product import advice_of
from viewer.table import Neighbours, why_worst, worst_of


def test_the_page_is_a_notebooks_value(tmp_path: Path) -> None:
    publish(small_publication("C0001"), tmp_path)
    shown = view(tmp_path, product="C0001", height=432)
    try:
        html = shown._repr_html_()
        assert "height: 432px" in html
        assert html.count("#C0001") == 1
        with urlopen(shown.url, timeout=20) as answer:
            assert "planetpose view" in answer.read().decode()
        assert shown.url in repr(shown)
    finally:
        shown.close()
    with pytest.raises(RefusedError, match="there is no store"):
        view(tmp_path / "nothing")


def test_stars_and_other_bodies_of_a_frame_are_layers(tmp_path: Path) -> None:
    """A moon with a ring beside the target, and a star, are where pose and camera put them."""
    alone, offset_km = pose_of(40.0), (120.0, 4000.0, -500.0)
    ring = Ring(name="a ring", inner_km=900.0, outer_km=1200.0, optical_depth=0.5)
    moon = PlacedBody(
        name="moon",
        naif_id=599,
        radii_km=(700.0, 700.0, 700.0),
        from_target_km=offset_km,
        sun_from_body_km=tuple(alone.sun_from_target_km - offset_km),
        rings=(ring,),
    )
    match = {"star": "HIP 1", "x_px": 20.5, "y_px": 30.25, "magnitude": 7.5, "used": True}
    measured = [{"name": "moon", "predicted_px": [80.0, 200.0], "measured_px": [80.5, 200.25]}]
    result = {
        "status": "ok",
        "bodies": measured,
        "roll_by": {"bodies": ["moon"], "roll_deg": 0.1, "sigma_deg": 0.02},
        "stars": {"stars": 1, "matches": [match], "unidentified": [{"x_px": 1, "y_px": 2}]},
    }
    publish(small_publication(pose_after=alone.replaced(bodies=(moon,)), result=result), tmp_path)
    page = client_of(tmp_path)[0].get("/api/products/C0001").json()
    (other,), (star, unidentified) = page["others"], page["stars"]
    centre = camera_of(160).project(alone.target_in_camera_km + offset_km)
    scale = 2e4 / (alone.target_in_camera_km + offset_km)[2]
    away = [np.hypot(*(np.array(curve) - centre).T) for curve in (other["limb"], *other["rings"])]
    assert other["name"] == "moon"
    np.testing.assert_allclose(away[0], 700 * scale, atol=0.1)
    assert [float(each.max()) for each in away[1:]] == pytest.approx([900 * scale, 1200 * scale], abs=0.1)
    assert other["measured_px"] == [80.5, 200.25]
    assert page["result"]["roll_by"] == result["roll_by"]
    assert (unidentified["star"], unidentified["xy"]) == (None, [1, 2])
    assert (star["star"], star["xy"], star["magnitude"]) == ("HIP 1", [20.5, 30.25], 7.5)


def test_the_worst_images_come_first_and_are_ranked_within_their_camera(tmp_path: Path) -> None:
    for number in range(8):
        result = {"status": "ok", "limb_rms_px": 0.1 * number, "uncertainty": {"centre_px": [0.01, 0.3]}}
        publish(small_publication(f"C000{number}", result=result), tmp_path)
    publish(small_publication("C0008", result={"status": "doubtful", "limb_rms_px": 0.01}), tmp_path)
    leave_failed(tmp_path, "C0009")
    client, _ = client_of(tmp_path)
    rows = client.get("/api/table", params={"sort": "worst", "down": True}).json()["rows"]
    assert [row["product"] for row in rows[:4]] == ["C0009", "C0008", "C0007", "C0006"]
    ranks = client.get("/api/products/C0007").json()["ranks"]
    assert (ranks["limb_rms_px"], ranks["sigma_px"]) == (1.0, 0.0)
    assert "limb_rms_px" not in client.get("/api/products/C0009").json()["ranks"]
    said = {name: client.get(f"/api/products/{name}").json()["worst"] for name in ("C0009", "C0008", "C0007", "C0000")}
    assert said == {
        "C0009": "1 of 10, failed: it has no product",
        "C0008": "2 of 10, it is doubtful; limb residual 0.01 px",
        "C0007": "3 of 10, limb residual 0.7 px",
        "C0000": "8 of 10, sigma of the centre 0.3 px",
    }


def test_a_close_up_is_not_the_worst_for_its_centre_outside_the_frame() -> None:
    table = pd.DataFrame({"status": ["ok", "ok", "doubtful"], "sigma_px": [165.0, 0.4, 90.0]})
    table["limb_rms_px"] = [np.nan, 0.3, np.nan]
    np.testing.assert_allclose(worst_of(table), [0.0, 0.4, 1000.0])
    assert why_worst("ok", 165.0, np.nan) == "no limb is measured"


def test_values_of_neighbours_are_those_of_the_same_camera_in_time() -> None:
    count = 12
    table = pd.DataFrame({name: np.arange(count, dtype=float) for name in ("sigma_px", "limb_rms_px")})
    table["camera"] = pd.Series(["a", "b"] * (count // 2)).astype("category")
    table["utc"] = pd.to_datetime(np.arange(count)[::-1], unit="D", utc=True).tz_localize(None)
    table.loc[2, "limb_rms_px"] = np.nan
    (first, last) = Neighbours(table).of([0, 11])
    assert first["sigma_px"] == [8, 6, 4, 2, 0, None, None, None, None]
    assert first["limb_rms_px"] == [8, 6, 4, None, 0, None, None, None, None]
    assert last["sigma_px"] == [None, None, None, None, 11, 9, 7, 5, 3]
    assert Neighbours(table).of([]) == []


def test_the_prefect_run_of_an_image_is_a_link_and_nothing_but_one(tmp_path: Path) -> None:
    publish(small_publication("C0001"), tmp_path)
    leave_failed(tmp_path, "C0002")
    run = {"flow_run": "1", "task_run": None, "name": "wise-owl", "url": "http://127.0.0.1:4200/runs/flow-run/1"}
    note_run(tmp_path, "C0001", run)
    assert noted_run(tmp_path, "C0001") is None  # no request is noted in this store, so no run is
    (tmp_path / ".requests").mkdir()
    for name in ("C0001", "C0002"):
        note_run(tmp_path, name, run)
    client, _ = client_of(tmp_path)
    assert [client.get(f"/api/products/{name}").json()["run"] for name in ("C0001", "C0002")] == [run, run]
    assert (failed_folder(tmp_path, "C0002") / "run.json").is_file()
    for url in ("javascript:alert(1)", "file:///etc/passwd", None):
        note_run(tmp_path, "C0001", run | {"url": url})
        assert noted_run(tmp_path, "C0001") is None
    note_run(tmp_path, "C0002", None)
    assert noted_run(tmp_path, "C0002") is None
    assert current_run() is None


def leave_failed(store: Path, name: str) -> None:
    """What a failed image leaves: the frame of a small product, result and what was tried."""
    made = small_publication(name, provenance={"basemap": {"name": "uniform", "sha256": "uniform"}})
    folder = failed_folder(store, name)
    folder.mkdir(parents=True)
    write_group(frame_dataset(made), folder / FRAME, {})
    reason = "target-not-found: the image shows no such disk. Check the target."
    note_result(folder, {"product": name, "status": "failed", "reason": reason, "camera": "test", "target": "europa"})
    content = {"explanations": [{"tried": "as-predicted", "likeness": 0.4, "size": 1.0, "limb_px": None}]}
    (folder / "tried.json").write_text(json.dumps(content))


def test_a_failed_image_has_its_frame_and_can_be_helped(tmp_path: Path) -> None:
    publish(small_publication("C0001"), tmp_path)
    leave_failed(tmp_path, "C0002")
    client, access = client_of(tmp_path)
    rows = client.get("/api/table", params={"text": "status = failed"}).json()["rows"]
    assert [(row["product"], row["camera"]) for row in rows] == [("C0002", "test")]
    page = client.get("/api/products/C0002").json()
    assert (page["failed"], page["size_px"], page["tried"][0]["likeness"]) == (True, [160, 160], 0.4)
    assert {"image", "quality", "simulation"} <= {each["name"] for each in page["planes"]}
    assert "latitude" not in {each["name"] for each in page["planes"]}
    assert [each["code"] for each in page["advice"]] == ["target-not-found"]
    image = np.frombuffer(client.get("/api/products/C0002/tiles/image/0/0/0").content, "<f4")
    simulation = np.frombuffer(client.get("/api/products/C0002/tiles/simulation/0/0/0").content, "<f4")
    lit = np.isfinite(simulation) & (simulation > 50)
    assert np.corrcoef(image[lit], simulation[lit])[0, 1] > 0.95
    assert "no pose of it is confirmed" in client.get("/api/products/C0002/at", params={"x": 1, "y": 1}).json()["fault"]
    assert client.get("/api/products/C0002/small.png").content.startswith(b"\x89PNG")
    headers = {"x-planetpose-token": access.token}
    given = {"action": "help", "why": "there", "help": {"centre_px": [90.0, 60.0]}}
    made = client.post("/api/products/C0002/decisions", json=given, headers=headers).json()
    assert len(made["decisions"][0]["options"]["start_offset_px"]) == 2
    assert export_store(tmp_path, tmp_path.parent / "page") == 2
    exported = json.loads((tmp_path.parent / "page/data/products/C0002/page.json").read_text())
    assert (exported["failed"], [each["name"] for each in exported["planes"]]) == (True, ["image", "quality"])
    assert exported["advice"][0]["code"] == "target-not-found"
    small = (tmp_path.parent / "page/data/products/C0002/small.png").read_bytes()
    assert small == client.get("/api/products/C0002/small.png").content
    table = json.loads((tmp_path.parent / "page/data/table.json").read_text())
    assert table["pictured"] == ["C0001", "C0002"]


def test_damage_in_what_a_failed_image_left_costs_only_that_image(tmp_path: Path) -> None:
    publish(small_publication("C0001"), tmp_path)
    for name in ("C0002", "C0003"):
        leave_failed(tmp_path, name)
    (failed_folder(tmp_path, "C0002") / "result.json").write_text("{")
    (failed_folder(tmp_path, "C0003") / "tried.json").write_text("[]")
    (tmp_path / "secret").mkdir()
    (tmp_path / ".failed" / "C0004").symlink_to(tmp_path / "secret")
    client, _ = client_of(tmp_path)
    rows = client.get("/api/table", params={"sort": "product"}).json()["rows"]
    assert [row["product"] for row in rows] == ["C0001", "C0003"]
    assert client.get("/api/products/C0003").json()["tried"] == []
    assert client.get("/api/products/C0002").status_code == 404


def test_what_reasons_mean_is_found_by_their_codes() -> None:
    reason = "range-conflict: 5 sigma. Look: here. markings-do-not-match: they are elsewhere. own-code: of a plugin."
    assert [each["code"] for each in advice_of(reason)] == ["range-conflict", "markings-do-not-match"]
    assert advice_of(None) == []


def test_shifts_of_the_markings_are_those_that_were_planted() -> None:
    """Another pose's picture stands for the image: its markings lie elsewhere by known pixels."""
    europa = find_target("europa")
    camera, after = camera_of(240), pose_of(100.0)
    scene = Scene(camera, europa, map_of_target(europa))
    planted = (1.5, -2.0)
    focal = camera.focal_length_px
    turn = rotation_from_vector_deg(np.degrees([planted[1] / focal, -planted[0] / focal, 0.0]))
    true = after.replaced(camera_from_j2000=turn @ after.camera_from_j2000)
    image = (500 * independent_image(camera, europa, true)).astype(np.float32)
    observation = Observation(image, np.full_like(image, 1), np.zeros(image.shape, np.uint16))
    product = Product("C1", observation, after, after, scene, ValidateSettings())
    found = flow_vectors(product, after)
    true_px, here_px = (camera.project(pose.target_in_camera_km) for pose in (true, after))
    assert len(found.xy_px) > 20
    np.testing.assert_allclose(np.median(found.shift_px, axis=0), true_px - here_px, atol=0.1)


def test_a_plane_that_does_not_decompress_is_damage_wherever_it_is_read(tmp_path: Path) -> None:
    publish(small_publication("C0001"), tmp_path)
    (tmp_path / "C0001/cube.zarr/image/c/0/0").write_bytes(b"no compressed pixels")
    (tmp_path / "C0001/cube.zarr/latitude/c/0/0").write_bytes(b"no compressed pixels")
    for damaged in (
        lambda: Planes(tmp_path).plane("C0001", "latitude"),
        lambda: write_thumbnail(tmp_path / "C0001", tmp_path / "small.png"),
        lambda: planes_figure(tmp_path / "C0001"),
        lambda: positions_of_pixels(read_position_model(tmp_path / "C0001"), [[60.0, 60.0]]),
    ):
        with pytest.raises(RefusedError, match=r"the cube in .*C0001 cannot be read .*decompress"):
            damaged()


def test_colours_have_the_contrast_that_the_style_sheet_promises() -> None:
    """WCAG 2.2, criteria 1.4.6 (text 7 to 1) and 1.4.11 (borders of controls 3 to 1), by its relative luminance."""
    style = (Path(__file__).parents[2] / "viewer" / "static" / "style.css").read_text()
    colours = dict(re.findall(r"--(\w+): (#[0-9a-f]{6});", style))

    def luminance(name: str) -> float:
        parts = np.array([int(colours[name][start : start + 2], 16) for start in (1, 3, 5)]) / 255
        linear = np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)
        return float(linear @ [0.2126, 0.7152, 0.0722])

    def contrast(first: str, second: str) -> float:
        dark, bright = sorted((luminance(first), luminance(second)))
        return (bright + 0.05) / (dark + 0.05)

    for ground in ("ground", "panel", "chosen", "under", "button"):
        for text in ("text", "quiet", "blue", "orange", "yellow", "green", "red"):
            assert contrast(text, ground) >= 7, (text, ground)
        if ground != "button":
            assert contrast("edge", ground) >= 3, ground
    assert contrast("disabled", "button") >= 4.5
