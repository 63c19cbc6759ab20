"""The example alert for real: a server, its automation, an event, and the address that is told."""

import json
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any

import pytest

from flows.reprocessing.report import TOO_MANY

ALERT = Path(__file__).parents[2] / "deploy" / "automations" / "alert.py"


@pytest.fixture
def told() -> Iterator[tuple[str, SimpleQueue[Any]]]:
    """An address of this machine, and what is posted there."""
    posted: SimpleQueue[Any] = SimpleQueue()

    class Ear(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            posted.put(json.loads(self.rfile.read(int(self.headers["content-length"]))))
            self.send_response(200)
            self.end_headers()

        def log_message(self, *_: Any) -> None:
            """Nothing."""

    server = HTTPServer(("127.0.0.1", 0), Ear)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}/hook", posted
    server.shutdown()
    server.server_close()


def test_too_many_failed_images_are_told_to_the_address(prefect_api: str, told: Any) -> None:
    from prefect.events import emit_event

    assert prefect_api
    url, posted = told
    spec = spec_from_file_location("alert", ALERT)
    assert spec is not None
    assert spec.loader is not None
    alert = module_from_spec(spec)
    spec.loader.exec_module(alert)
    assert alert.EVENT == TOO_MANY
    alert.main(url)
    alert.main(url)  # made anew, not twice
    summary = {"failed_percent": 12.5, "images": 8, "list": "europa57", "codes": {"no-limb": 1}, "store": "out"}
    message = None
    for _ in range(30):  # the server takes up a new automation in its own time
        emit_event(TOO_MANY, {"prefect.resource.id": "planetpose.store.out"}, payload=summary)
        try:
            message = posted.get(timeout=4)
            break
        except Empty:
            continue
    assert message is not None
    assert "12.5 % of 8 images of europa57" in message["text"]
