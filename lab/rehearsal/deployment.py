"""Deployments of a rehearsal, which deploy/setup.sh makes, and requests to the server about them."""

import json
import os
import sys
import time
import urllib.request
from base64 import b64encode
from pathlib import Path
from typing import Any

from catalog.settings import PROJECT_ROOT
from lab.rehearsal.processes import CREDENTIALS, Installation

POOL = "planetpose"
SET_UP = PROJECT_ROOT / "deploy" / "setup.sh"
ENDED = ("COMPLETED", "FAILED", "CRASHED", "CANCELLED")


def set_up(installation: Installation, images: Path, store: str) -> None:
    """Run deploy/setup.sh, as deploy/README.md has it. Raises RehearsalError with what it said when it fails."""
    binaries = f"{Path(sys.executable).parent}{os.pathsep}{os.environ.get('PATH', '')}"
    requested = {"PLANETPOSE_IMAGES": str(images), "PLANETPOSE_STORE": store, "PATH": binaries}
    installation.run(["sh", str(SET_UP)], requested)


class Api:
    """What a rehearsal asks the server."""

    def __init__(self, installation: Installation) -> None:
        self._url = installation.api_url

    def post(self, path: str, content: Any) -> Any:
        """The answer to a POST."""
        return self._call("POST", path, content)

    def _call(self, method: str, path: str, content: Any) -> Any:
        """The answer to a call; one that a restarting database breaks is tried again."""
        request = urllib.request.Request(f"{self._url}{path}", json.dumps(content).encode(), method=method)
        request.add_header("Content-Type", "application/json")
        request.add_header("Authorization", "Basic " + b64encode(CREDENTIALS.encode()).decode())
        for wait_s in (0.5, 1, 2, 4, 8, None):
            try:
                with urllib.request.urlopen(request, timeout=30) as reply:
                    return json.loads(reply.read() or "null")
            except OSError:
                if wait_s is None:
                    raise
                time.sleep(wait_s)
        return None

    def runs(self) -> list[dict[str, Any]]:
        """Flow runs, first begun first."""
        return list(self.post("/flow_runs/filter", {"sort": "EXPECTED_START_TIME_ASC", "limit": 200}))

    def runs_in(self, *states: str) -> list[dict[str, Any]]:
        """Flow runs whose state is one of these types."""
        return [run for run in self.runs() if run["state_type"] in states]

    def start(self, deployment: str, parameters: dict[str, Any]) -> str:
        """Have a deployment run now, with some parameters replaced; the run's id."""
        found = self._deployment(deployment)
        requested = {"state": {"type": "SCHEDULED"}, "parameters": {**found["parameters"], **parameters}}
        return str(self.post(f"/deployments/{found['id']}/create_flow_run", requested)["id"])

    def schedule(self, deployment: str, every_s: float, parameters: dict[str, Any]) -> None:
        """Have a deployment run every so many seconds, with some parameters replaced."""
        found = self._deployment(deployment)
        path = f"/deployments/{found['id']}"
        self._call("PATCH", path, {"parameters": {**found["parameters"], **parameters}})
        self.post(f"{path}/schedules", [{"active": True, "schedule": {"interval": every_s}}])

    def let_run(self, pool: str, runs: int) -> None:
        """How many runs of a work pool may be at work at a time."""
        self._call("PATCH", f"/work_pools/{pool}", {"concurrency_limit": runs})

    def pause(self, deployment: str) -> None:
        """Let its schedule rest; runs that are only planned are forgotten."""
        self.post(f"/deployments/{self._deployment(deployment)['id']}/pause_deployment", {})

    def _deployment(self, name: str) -> dict[str, Any]:
        return dict(self.post("/deployments/filter", {"deployments": {"name": {"any_": [name]}}})[0])

    def state_of(self, run: str) -> str:
        """Type of a flow run's state."""
        return str(self.post("/flow_runs/filter", {"flow_runs": {"id": {"any_": [run]}}})[0]["state_type"])


def products(store: Path) -> list[str]:
    """Names of whole products in a store."""
    return sorted(path.parent.name for path in store.glob("*/record.json"))
