"""Deployments of a rehearsal: those of deploy/prefect.yaml, with a schedule that fires within seconds."""

import json
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
ENDED = ("COMPLETED", "FAILED", "CRASHED", "CANCELLED")


def rehearsed(deployment: str, parameters: dict[str, Any], every_s: float | None) -> dict[str, Any]:
    """deploy/prefect.yaml with only the named deployment, other parameters, and a schedule every so many seconds
    (None: no schedule)."""
    content = yaml.safe_load(PREFECT_FILE.read_text(encoding="utf-8"))
    chosen = next(entry for entry in content["deployments"] if entry["name"] == deployment)
    chosen["parameters"] = {**chosen.get("parameters", {}), **parameters}
    chosen["schedules"] = [{"interval": every_s}] if every_s else []
    return {**content, "deployments": [chosen]}


def deploy(installation: Installation, deployment: str, parameters: dict[str, Any], every_s: float | None) -> None:
    """Make the work pool and the deployment, as deploy/README.md has it."""
    path = installation.folder / "prefect.yaml"
    path.write_text(yaml.safe_dump(rehearsed(deployment, parameters, every_s)), encoding="utf-8")
    home = {"PLANETPOSE_HOME": str(PROJECT_ROOT)}
    installation.prefect("work-pool", "create", POOL, "--type", "process", "--overwrite")
    # Entry points are relative to the project, and so is the folder that `prefect deploy` runs in.
    installation.prefect("deploy", "--prefect-file", str(path), "--all", environment=home, folder=PROJECT_ROOT)


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

    def finished_tasks(self, run: str) -> int:
        """Tasks of a flow run that are completed."""
        query = {"flow_runs": {"id": {"any_": [run]}}, "task_runs": {"state": {"type": {"any_": ["COMPLETED"]}}}}
        return int(self.post("/task_runs/count", query))

    def start(self, deployment: str) -> str:
        """Have a deployment run now; the run's id."""
        found = self.post("/deployments/filter", {"deployments": {"name": {"any_": [deployment]}}})
        return str(self.post(f"/deployments/{found[0]['id']}/create_flow_run", {"state": {"type": "SCHEDULED"}})["id"])


def products(store: Path) -> list[str]:
    """Names of whole products in a store."""
    return sorted(path.parent.name for path in store.glob("*/record.json"))
