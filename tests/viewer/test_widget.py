"""The widget of notebooks: its messages in Python, and its picture in a browser that reaches no server of the page."""

import json
import struct
import sys
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from small_product import small_publication

import planetpose
from catalog.errors import RefusedError
from lab.page.browser import browser_page, find_browser
from lab.page.drive import View
from tasks.publish import publish
from tasks.publish.cube import open_cube
from viewer.side import Side
from viewer.widget import TILE_PX, answer_of, module_text


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("out")
    for name in ("C0001", "C0002"):
        publish(small_publication(name, size=300), folder)
    return folder


def test_the_widget_answers_through_its_channel(store: Path) -> None:
    made = planetpose.widget(store, product="C0002")
    sent: list[tuple[dict[str, Any], list[bytes]]] = []
    made.send = lambda content, buffers: sent.append((content, buffers))
    assert (made.product, made.products, made.places) == ("C0002", ["C0001", "C0002"], [])
    place = {"product": "C0002", "planes": ["image", "latitude"], "level": 0, "column": 1, "row": 0}
    made._handle_custom_msg({"number": 7, "ask": "tiles", **place}, [])
    (content, (tiles,)) = sent[0]
    cube = open_cube(store / "C0002" / "cube.zarr")
    wanted = [cube[name].values[:TILE_PX, TILE_PX:].astype(np.float32) for name in ("image", "latitude")]
    assert content == {"number": 7}
    np.testing.assert_array_equal(np.frombuffer(tiles, "<f4"), np.concatenate([each.ravel() for each in wanted]))
    made._handle_custom_msg({"number": 8, "ask": "at", "product": "C0002", "x": 140.0, "y": 150.0}, [])
    assert sent[1][0]["result"]["latitude_deg"] == pytest.approx(float(cube.latitude[150, 140]), abs=1e-4)


WRONG = [
    ({"ask": "everything"}, "no such request"),
    ({"ask": "opening", "product": "../C0001", "plane": "image"}, "no such product"),
    ({"ask": "opening", "product": "C0001"}, "incomplete"),
    ({"ask": "tiles", "product": "C0001", "planes": ["none"], "level": 0, "column": 0, "row": 0}, "no plane 'none'"),
    ({"ask": "tiles", "product": "C0001", "planes": ["image"], "level": 99, "column": 0, "row": 0}, "incomplete"),
    ({"ask": "at", "product": "C0001", "x": "left", "y": 0}, "incomplete"),
]


@pytest.mark.parametrize(("request_", "fault"), WRONG)
def test_a_wrong_request_is_answered_by_its_fault(store: Path, request_: dict[str, Any], fault: str) -> None:
    content, buffers = answer_of(Side(store), {"number": 3, **request_})
    assert (content["number"], buffers) == (3, [])
    assert fault in content["fault"]


def test_a_widget_needs_its_product_and_its_package(store: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(RefusedError, match="has no product C0009"):
        planetpose.widget(store, product="C0009")
    monkeypatch.delitem(sys.modules, "viewer.widget")
    monkeypatch.setitem(sys.modules, "anywidget", None)
    with pytest.raises(ModuleNotFoundError, match=r"planetpose\[notebook\]"):
        planetpose.widget(store)


PAGE = """<body><div id="cell" style="width: 800px"></div><script type="module">
import widget from "./widget.js";
const state = { product: "C0001", products: ["C0001", "C0002"], places: [], height: 400 }, on = {};
const fire = (name, ...given) => (on[name] ?? []).forEach((each) => each(...given));
window.model = {
  get: (name) => state[name],
  set: (name, value) => { state[name] = value; fire(`change:${name}`); },
  save_changes: () => {},
  on: (name, does) => { (on[name] ??= []).push(does); },
  off: (name, does) => { on[name] = on[name].filter((each) => each !== does); },
  send: async (content) => {
    const answer = await (await fetch("ask", { method: "POST", body: JSON.stringify(content) })).arrayBuffer();
    const length = new DataView(answer).getUint32(0, true), rest = 4 + length;
    const content_ = JSON.parse(new TextDecoder().decode(new Uint8Array(answer, 4, length)));
    fire("msg:custom", content_, rest < answer.byteLength ? [new DataView(answer, rest)] : []);
  },
};
window.on = on;
window.cleanUp = widget.render({ model, el: document.getElementById("cell") });
</script>"""


@pytest.fixture
def address(store: Path) -> Iterator[str]:
    """A page with the widget; what a notebook carries through its connection goes through `ask` here."""
    side = Side(store, TILE_PX)

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            kind, text = ("text/javascript", module_text()) if self.path == "/widget.js" else ("text/html", PAGE)
            self.answer(f"{kind}; charset=utf-8", text.encode())

        def do_POST(self) -> None:
            content, buffers = answer_of(side, json.loads(self.rfile.read(int(self.headers["content-length"]))))
            text = json.dumps(content).encode()
            self.answer("application/octet-stream", struct.pack("<I", len(text)) + text + b"".join(buffers))

        def answer(self, kind: str, content: bytes) -> None:
            self.send_response(200)
            self.send_header("content-type", kind)
            self.end_headers()
            self.wfile.write(content)

        def log_message(self, *_: object) -> None:
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}/index.html"
        server.shutdown()


@pytest.mark.skipif(find_browser() is None, reason="no Chromium or Chrome is installed")
def test_the_picture_is_drawn_and_hovered_in_a_browser(address: str, store: Path, tmp_path: Path) -> None:
    with browser_page(str(find_browser()), tmp_path / "browser") as page:
        view = View(page)
        page.open(address, 1000, 700)
        view.wait("document.getElementById('cell').dataset.drawn === 'C0001'")
        canvas = "#cell canvas"
        bright = f"""(() => {{ const c = document.querySelector('{canvas}');
            const d = c.getContext('2d').getImageData(c.width / 2, c.height / 2, 1, 1).data; return d[0]; }})()"""
        assert page.ask(bright) > 60
        x, y = view.middle(canvas)
        view.mouse("mouseMoved", x + 5, y + 5)
        view.wait("/latitude .*longitude .*phase [0-9]/.test(document.querySelector('#cell output').textContent)")
        view.click(canvas)
        view.wait("model.get('places').length === 1")
        place = page.ask("model.get('places')[0]")
        cube = open_cube(store / "C0001" / "cube.zarr")
        there = cube.latitude.sel(x=round(place["x_px"]), y=round(place["y_px"]))
        assert place["latitude_deg"] == pytest.approx(float(there), abs=0.6)
        page.ask("document.querySelector('#cell input[name=grid]').click()")
        page.ask("model.set('product', 'C0002')")
        view.wait("document.getElementById('cell').dataset.drawn === 'C0002'")
        page.ask("model.set('product', 'C0009')")
        view.wait("document.querySelector('#cell [role=alert]').textContent.includes('no such product')")
        page.ask("cleanUp()")
        assert page.ask("on['msg:custom'].length + on['change:product'].length") == 0
        assert page.complaints == []
