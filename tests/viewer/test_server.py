"""The server: pages of the table, tiles, what may be read and written, by whom."""

import base64
import gzip
import io
import json
from pathlib import Path

import numpy as np
import pytest
from client import client_of
from fastapi.testclient import TestClient
from PIL import Image
from small_product import small_publication

from catalog.errors import RefusedError, WrongOptionError
from tasks.guidance.decisions import GUIDANCE, decisions_of
from tasks.publish import publish
from tasks.publish.cube import open_cube
from viewer.app import FAULT, build_app
from viewer.export import export_store
from viewer.planes import Planes, levels_of, opening_level, reduced
from viewer.security import Access
from viewer.serving import listening_socket
from viewer.table import Table

OWN = {"host": "127.0.0.1:8080"}


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("out")
    for number, rms in enumerate((0.31, 0.9, 0.05)):
        result = {"status": "doubtful" if rms > 0.5 else "ok", "reason": None, "limb_rms_px": rms}
        publish(small_publication(f"C000{number}", result={**result, "uncertainty": {"centre_px": [0.1, rms]}}), folder)
    return folder


@pytest.fixture
def client(store: Path) -> TestClient:
    return client_of(store)[0]


def test_the_table_comes_in_pages_sorted_and_filtered(client: TestClient) -> None:
    page = client.get("/api/table", params={"text": "sigma > 0.2", "sort": "limb", "down": True, "count": 1}).json()
    assert (page["fitting"], page["images"], page["counts"]) == (2, 3, {"doubtful": 1, "ok": 1})
    assert [row["product"] for row in page["rows"]] == ["C0001"]
    second = client.get("/api/table", params={"text": "sigma > 0.2", "sort": "limb", "down": True, "first": 1}).json()
    assert [row["product"] for row in second["rows"]] == ["C0000"]
    assert client.get("/api/place", params={"product": "C0002", "sort": "limb"}).json() == {"place": 0}
    wrong = client.get("/api/table", params={"text": "sigma > big"})
    assert (wrong.headers[FAULT], "is a number" in wrong.json()["fault"]) == ("1", True)
    points = client.get("/api/points", params={"x": "utc", "y": "limb"}).json()
    assert (len(points["x"]), points["every"]) == (3, 1)
    assert "no number" in client.get("/api/points", params={"x": "camera", "y": "limb"}).json()["fault"]


def test_tiles_are_the_planes_of_the_cube(client: TestClient, store: Path) -> None:
    page = client.get("/api/products/C0000").json()
    assert (page["size_px"], page["levels"], page["row"]["status"]) == ([160, 160], 1, "ok")
    cube = open_cube(store / "C0000" / "cube.zarr")
    for name in ("image", "latitude", "quality"):
        content = client.get(f"/api/products/C0000/tiles/{name}/0/0/0").content
        values = np.frombuffer(content, "<f4").reshape(160, 160)
        np.testing.assert_array_equal(values, cube[name].values.astype(np.float32))
    for wrong in ("latitud/0/0/0", "image/0/7/0", "image/99/0/0", "image/0/-1/0"):
        answer = client.get(f"/api/products/C0000/tiles/{wrong}")
        assert answer.status_code == 404 or answer.json()["fault"], wrong
    found = client.get("/api/products/C0000/at", params={"x": 70, "y": 95}).json()
    assert found["latitude_deg"] == pytest.approx(float(cube.latitude[95, 70]), abs=1e-4)
    assert "beyond 90" in client.get("/api/products/C0000/find", params={"place": "95N,3"}).json()["fault"]
    limb = np.array(page["curves"]["after"]["limb"])
    assert np.hypot(*(limb - page["centre_px"]).T) == pytest.approx(60, abs=0.5)


@pytest.mark.parametrize("plane", ["image", "latitude", "no_such_plane"])
def test_an_image_is_opened_by_one_answer(client: TestClient, store: Path, plane: str) -> None:
    content = client.get("/api/products/C0000/opening", params={"plane": plane}).content
    length = int(np.frombuffer(content, "<u4", 1)[0])
    page = json.loads(content[4 : 4 + length])
    opening = page.pop("opening", None)
    assert page == client.get("/api/products/C0000").json()
    assert len(content) % 4 == 0
    if plane == "no_such_plane":
        assert (opening, len(content)) == (None, 4 + length)
        return
    assert opening == {"plane": plane, "level": 0}
    values = np.frombuffer(content, "<f4", offset=4 + length).reshape(160, 160)
    np.testing.assert_array_equal(values, open_cube(store / "C0000" / "cube.zarr")[plane].values.astype(np.float32))


def test_tiles_of_a_level_follow_each_other_row_by_row(store: Path) -> None:
    planes = Planes(store, tile_px=96)
    whole = planes.plane("C0000", "image")
    values = np.frombuffer(planes.tiles("C0000", "image", 0), "<f4")
    parts = [whole[y : y + 96, x : x + 96].ravel() for y in (0, 96) for x in (0, 96)]
    np.testing.assert_array_equal(values, np.concatenate(parts))
    assert [opening_level((n, 3)) for n in (160, 1024, 1025, 2048, 5000)] == [0, 0, 1, 1, 3]


def test_tiles_of_several_planes_come_together(client: TestClient) -> None:
    both = client.get("/api/products/C0000/tiles/image,quality/0/0/0").content
    single = [client.get(f"/api/products/C0000/tiles/{name}/0/0/0").content for name in ("image", "quality")]
    assert both == b"".join(single)


def test_a_small_picture_is_sent_once_while_the_product_stays(tmp_path: Path) -> None:
    publish(small_publication("C0001"), tmp_path)
    client, _ = client_of(tmp_path)
    first = client.get("/api/products/C0001/small.png")
    assert Image.open(io.BytesIO(first.content)).size == (128, 128)
    known = {"if-none-match": first.headers["etag"]}
    again = client.get("/api/products/C0001/small.png", headers=known)
    assert (again.status_code, again.content) == (304, b"")
    publish(small_publication("C0001"), tmp_path)
    assert client.get("/api/products/C0001/small.png", headers=known).status_code == 200


def test_reduced_planes_keep_means_and_never_mix_flags() -> None:
    plane = np.arange(35, dtype=np.float32).reshape(5, 7)
    plane[0, 0] = np.nan
    half = reduced(plane, nearest=False)
    assert half.shape == (3, 4)
    assert half[0, 0] == np.mean([1, 7, 8], dtype=np.float32)
    assert half[2, 3] == 34
    np.testing.assert_array_equal(reduced(plane, nearest=True), plane[::2, ::2])
    assert [levels_of((n, 3)) for n in (512, 513, 1025, 4096)] == [1, 2, 3, 4]


def test_only_products_of_the_store_are_served(client: TestClient, store: Path) -> None:
    (store.parent / "secret").mkdir(exist_ok=True)
    for name in ("../secret", "..%2fsecret", "%2e%2e", ".guidance", "C9999", "C0000%2f..%2fC0001", "index.parquet"):
        assert client.get(f"/api/products/{name}/overlay.png").status_code == 404, name
        assert client.get(f"/api/products/{name}").status_code == 404, name
    for name in ("../app.py", "..%2fapp.py", "index.html", "nothing.js"):
        assert client.get(f"/static/{name}").status_code == 404, name
    assert client.get("/static/main.js").headers["content-type"].startswith("text/javascript")


def test_a_link_out_of_the_store_is_not_followed(tmp_path: Path) -> None:
    publish(small_publication("C0001"), tmp_path / "out")
    (tmp_path / "secret.png").write_bytes(b"secret")
    overlay = tmp_path / "out" / "C0001" / "overlay.png"
    overlay.unlink()
    overlay.symlink_to(tmp_path / "secret.png")
    client, _ = client_of(tmp_path / "out")
    assert client.get("/api/products/C0001/overlay.png").status_code == 404
    assert "result" not in client.get("/api/products/C0001").json()


FOREIGN = [
    {"host": "evil.example:8080"},
    {"host": "127.0.0.1:9999"},
    {"origin": "http://evil.example"},
    {"origin": "http://127.0.0.1:9999"},
    {"sec-fetch-site": "cross-site"},
    {"sec-fetch-site": "same-site"},
]


@pytest.mark.parametrize("headers", FOREIGN)
def test_other_sites_get_nothing_and_change_nothing(store: Path, headers: dict[str, str]) -> None:
    client, access = client_of(store)
    token = {"x-planetpose-token": access.token}
    assert client.get("/api/table", headers=headers).status_code in (403, 421)
    made = client.post("/api/products/C0000/decisions", json={"action": "accept"}, headers=headers | token)
    assert made.status_code in (403, 421)
    assert decisions_of(store, "C0000") == []


def test_a_link_from_elsewhere_opens_the_page_and_no_page_may_frame_it(client: TestClient) -> None:
    visit = {"sec-fetch-site": "cross-site", "sec-fetch-mode": "navigate", "sec-fetch-dest": "document"}
    page = client.get("/", headers=visit)
    assert page.status_code == 200
    assert "frame-ancestors 'none'" in page.headers["content-security-policy"]
    assert client.get("/", headers=visit | {"sec-fetch-dest": "iframe"}).status_code == 403


def test_a_notebook_may_frame_the_page_by_its_token_alone(store: Path) -> None:
    client, access = client_of(store, framed=True)
    frame = {"sec-fetch-site": "cross-site", "sec-fetch-mode": "navigate", "sec-fetch-dest": "iframe"}
    page = client.get("/", headers=frame, params={"token": access.token})
    assert (page.status_code, "frame-ancestors" in page.headers["content-security-policy"]) == (200, False)
    for token in ({}, {"token": "wrong"}):
        assert client.get("/", headers=frame, params=token).status_code == 403
        assert "frame-ancestors 'none'" in client.get("/", params=token).headers["content-security-policy"]
    unframed, other = client_of(store)
    assert unframed.get("/", headers=frame, params={"token": other.token}).status_code == 403


def test_writing_needs_the_token_of_the_page(tmp_path: Path) -> None:
    publish(small_publication("C0001"), tmp_path)
    client, access = client_of(tmp_path)
    path, body = "/api/products/C0001/decisions", {"action": "accept", "why": "fine"}
    assert access.token in client.get("/").text
    for headers in ({}, {"x-planetpose-token": "wrong"}, {"x-planetpose-token": access.token, "origin": "null"}):
        assert client.post(path, json=body, headers=headers).status_code == 403
    made = client.post(path, json=body, headers={"x-planetpose-token": access.token})
    assert (made.status_code, made.json()["row"]["review"]) == (200, "accepted")
    assert [each.why for each in decisions_of(tmp_path, "C0001")] == ["fine"]
    assert client.get("/api/table", params={"text": "review = accepted"}).json()["fitting"] == 1
    undone = client.post("/api/products/C0001/undo", headers={"x-planetpose-token": access.token})
    assert not undone.json()["row"]["review"]
    huge = {"x-planetpose-token": access.token, "content-length": "99000000"}
    assert client.post(path, content=b"", headers=huge).status_code == 413
    unknown = client.post(path, json={"action": "explode"}, headers={"x-planetpose-token": access.token})
    assert "known are accept" in unknown.json()["fault"]


def test_read_only_pages_have_no_token_and_write_nothing(tmp_path: Path) -> None:
    publish(small_publication("C0001"), tmp_path)
    client, access = client_of(tmp_path, read_only=True)
    assert access.token not in client.get("/").text
    headers = {"x-planetpose-token": access.token}
    for path in ("decisions", "undo", "redo"):
        assert client.post(f"/api/products/C0001/{path}", json={}, headers=headers).status_code in (403, 404, 405)
    assert not (tmp_path / GUIDANCE).exists()


def test_other_machines_need_the_token_for_everything(store: Path) -> None:
    client, access = client_of(store, host="0.0.0.0")
    far = {"host": "192.168.7.3:8080"}
    assert access.url().endswith(access.token)
    assert client.get("/", headers=far).status_code == 401
    assert client.get("/api/table", headers=far).status_code == 401
    assert client.get("/", headers={"host": "evil.example:8080"}, params={"token": access.token}).status_code == 421
    page = client.get("/", headers=far, params={"token": access.token})
    assert (page.status_code, "HttpOnly" in page.headers["set-cookie"]) == (200, True)
    cookie = {"cookie": f"planetpose-token={access.token}"}
    assert client.get("/api/table", headers=far | cookie).status_code == 200
    assert client.get("/api/table", headers=far | {"cookie": "planetpose-token=x"}).status_code == 401


def test_help_becomes_guidance_with_its_mask(tmp_path: Path) -> None:
    publish(small_publication("C0001"), tmp_path)
    client, access = client_of(tmp_path)
    picture = np.zeros((160, 160, 4), np.uint8)
    picture[10:20, 30:50, 3] = 255
    stream = io.BytesIO()
    Image.fromarray(picture).save(stream, "PNG")
    given = {"centre_px": [90.0, 60.0], "hold": ["roll"], "mask": base64.b64encode(stream.getvalue()).decode()}
    headers = {"x-planetpose-token": access.token}
    path = "/api/products/C0001/decisions"
    made = client.post(path, json={"action": "help", "why": "seen", "help": given}, headers=headers)
    assert made.status_code == 200, made.text
    options = decisions_of(tmp_path, "C0001")[0].options
    assert (options["hold"], options["mask"]) == (["roll"], "C0001.mask.png")
    assert len(options["start_offset_px"]) == 2
    for wrong in ({"mask": "AAAA"}, {"hold": ["everything"]}, {"range_factor": 0}, {"profile": "no-such"}):
        answer = client.post(path, json={"action": "help", "help": wrong}, headers=headers)
        assert answer.json()["fault"], wrong
    assert len(decisions_of(tmp_path, "C0001")) == 1


def test_two_stores_are_compared_and_a_missing_one_is_refused(store: Path, tmp_path: Path) -> None:
    publish(small_publication("C0000"), tmp_path / "b")
    app = build_app(store, Access(port=8080), tmp_path / "b")
    client = TestClient(app, base_url="http://127.0.0.1:8080")
    assert client.get("/api/products/C0000/tiles/image/0/0/0", params={"side": 1}).status_code == 200
    assert client.get("/api/table", params={"side": 1}).json()["images"] == 1
    assert "no second store" in client.get("/api/table", params={"side": 2}).json()["fault"]
    with pytest.raises(RefusedError, match="there is no store"):
        build_app(tmp_path / "nothing", Access())


def test_files_for_a_web_server_hold_the_same(store: Path, tmp_path: Path) -> None:
    assert export_store(store, tmp_path / "page", "sigma > 0.2") == 2
    table = json.loads((tmp_path / "page/data/table.json").read_text())
    assert [row[0] for row in table["rows"]] == ["C0000", "C0001"]
    page = json.loads((tmp_path / "page/data/products/C0001/page.json").read_text())
    tile = gzip.decompress((tmp_path / "page/data/products/C0001/latitude/0-0-0.bin.gz").read_bytes())
    plane = Planes(store).plane("C0001", "latitude")
    np.testing.assert_array_equal(np.frombuffer(tile, "<f4").reshape(page["size_px"][::-1]), plane)
    assert 'content="data"' in (tmp_path / "page/index.html").read_text()
    text = "".join(path.read_text() for path in (tmp_path / "page/data").rglob("*.json"))
    assert str(store.parent) not in text
    assert export_store(store, tmp_path / "page") == 3  # replaced as a whole
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "mine.txt").write_text("")
    with pytest.raises(FileExistsError, match="holds something else"):
        export_store(store, tmp_path / "full")


def test_images_without_a_product_are_in_the_table(store: Path, tmp_path: Path) -> None:
    from flows.options import BOOKS
    from tasks.outcomes import Outcome, write_outcome

    publish(small_publication("C0001"), tmp_path)
    for name, status in (("C0001", "ok"), ("C0007", "refused")):
        write_outcome(tmp_path / BOOKS, Outcome(name, f"{name}.IMG", status, "no-limb: none", "run", "now"))
    rows = Table(tmp_path).page("status = refused").rows
    assert [(row["product"], row["reason"]) for row in rows] == [("C0007", "no-limb: none")]
    client, _ = client_of(tmp_path)
    assert client.get("/api/products/C0007").json()["row"]["status"] == "refused"


def test_a_port_that_is_taken_is_said() -> None:
    taken = listening_socket("127.0.0.1", 0)
    with taken, pytest.raises(WrongOptionError, match="cannot be listened on"):
        listening_socket("127.0.0.1", taken.getsockname()[1])
