"""Deployments of a rehearsal: those of deploy/prefect.yaml, with a schedule that fires within seconds."""

import json
import os
import sys
import time
import urllib.request
from base64 import b64encode
from pathlib import Path
from typing import Any

import yaml  # type: ignore[import-untyped]

from catalog.settings import PROJECT_ROOT
from flows.rehearsal.processes import CREDENTIALS, Installation

POOL = "planetpose"
PREFECT_FILE = PROJECT_ROOT / "deploy" / "prefect.yaml"
SET_UP = PROJECT_ROOT / "deploy" / "setup.sh"
TEMPLATED = {"PLANETPOSE_HOME": str(PROJECT_ROOT), "PLANETPOSE_RUNNER": "threads", "PLANETPOSE_TIMEZONE": "UTC"}
ENDED = ("COMPLETED", "FAILED", "CRASHED", "CANCELLED")


def rehearsed(deployment: str, parameters: dict[str, Any], every_s: float) -> dict[str, Any]:
    """deploy/prefect.yaml with only the named deployment, some other parameters, and a schedule of so many seconds."""
    content = yaml.safe_load(PREFECT_FILE.read_text(encoding="utf-8"))
    chosen = next(entry for entry in content["deployments"] if entry["name"] == deployment)
    chosen["parameters"] = {**chosen.get("parameters", {}), **parameters}
    chosen["schedules"] = [{"interval": every_s}]
    return {**content, "deployments": [chosen]}


def set_up(installation: Installation, images: Path, store: str) -> None:
    """Run deploy/setup.sh, as deploy/README.md has it. Raises RehearsalError with what it said when it fails."""
    binaries = f"{Path(sys.executable).parent}{os.pathsep}{os.environ.get('PATH', '')}"
    asked = {"PLANETPOSE_IMAGES": str(images), "PLANETPOSE_STORE": store, "PATH": binaries}
    installation.run(["sh", str(SET_UP)], asked)


def deploy(installation: Installation, deployment: str, parameters: dict[str, Any], every_s: float) -> None:
    """Replace a deployment that `set_up` made (see `rehearsed`)."""
    path = installation.folder / "prefect.yaml"
    path.write_text(yaml.safe_dump(rehearsed(deployment, parameters, every_s)), encoding="utf-8")
    # Entry points are relative to the project, and so is the folder that `prefect deploy` runs in.
    command = [sys.executable, "-m", "prefect", "--no-prompt", "deploy", "--prefect-file", str(path), "--all"]
    installation.run(command, TEMPLATED, PROJECT_ROOT)


class Api:
    """What a rehearsal asks the server."""

    def __init__(self, installation: Installation) -> None:
        self._url = installation.api_url

    def post(self, path: str, content: dict[str, Any]) -> Any:
        """The answer to a POST; connections that a restarting database breaks are tried again."""
        request = urllib.request.Request(f"{self._url}{path}", json.dumps(content).encode(), method="POST")
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
        asked = {"state": {"type": "SCHEDULED"}, "parameters": {**found["parameters"], **parameters}}
        return str(self.post(f"/deployments/{found['id']}/create_flow_run", asked)["id"])

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
