"""The example alert for real: a server, its automation, an event, and the address that is notified."""

import json
import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import pytest

from flows.reprocess import TOO_MANY

ROOT = Path(__file__).parents[2]
ALERT = ROOT / "deploy" / "automations" / "alert.py"


@pytest.fixture
def reported() -> Iterator[tuple[str, SimpleQueue[Any]]]:
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


# In a process of its own: Prefect remembers where the server was that another test of this process used.
TELLS = """
import sys, time
from importlib.util import module_from_spec, spec_from_file_location
from local_server.prefect_settings import prepare
prepare("local")
from prefect.events import emit_event
spec = spec_from_file_location("alert", sys.argv[1])
alert = module_from_spec(spec)
spec.loader.exec_module(alert)
alert.main(sys.argv[2])
alert.main(sys.argv[2])  # made anew, not twice
summary = {"failed_percent": 12.5, "images": 8, "list": "europa57", "codes": {"no-limb": 1}, "store": "out"}
while True:  # the server takes up a new automation in its own time
    emit_event(alert.EVENT, {"prefect.resource.id": "planetpose.store.out"}, payload=summary)
    time.sleep(4)
"""


def test_too_many_failed_images_are_reported_to_the_address(server_state: Path, reported: Any) -> None:
    assert server_state
    url, posted = reported
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PREFECT_API")}
    environment["PYTHONPATH"] = str(ROOT)
    with subprocess.Popen([sys.executable, "-c", TELLS, str(ALERT), url], env=environment) as reporting:
        try:
            message = posted.get(timeout=300)
        finally:
            reporting.kill()
    assert "12.5 % of 8 images of europa57" in message["text"]


def test_the_alert_waits_for_the_event_that_reprocess_emits() -> None:
    spec = spec_from_file_location("alert", ALERT)
    assert spec is not None
    assert spec.loader is not None
    alert = module_from_spec(spec)
    spec.loader.exec_module(alert)
    assert alert.EVENT == TOO_MANY
