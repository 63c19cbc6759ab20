"""A deployment for real: Prefect on PostgreSQL behind a password, set up by deploy/setup.sh, a worker, a schedule.

`planetpose benchmark deploy` also kills server and worker; that takes minutes.
"""

import urllib.error
import urllib.request
from base64 import b64encode
from collections.abc import Iterator

import pytest

from lab.rehearsal.deployment import products
from lab.rehearsal.postgres import postgres_binaries
from lab.rehearsal.processes import CREDENTIALS, wait_until
from lab.rehearsal.scenarios import DEPLOYMENT, EVERY_S, Stage, stage

IMAGES = 3

pytestmark = pytest.mark.skipif(
    postgres_binaries() is None, reason="PostgreSQL is not installed (Debian: apt-get install postgresql)"
)


@pytest.fixture(scope="module")
def on() -> Iterator[Stage]:
    with stage(IMAGES) as prepared:
        yield prepared
        if worker := prepared.sessions.get("worker"):
            worker.lose()  # it would wait for the runs that the schedule goes on beginning


def status_of(address: str, credentials: str | None) -> int:
    """HTTP status of a GET."""
    request = urllib.request.Request(address)
    if credentials:
        request.add_header("Authorization", "Basic " + b64encode(credentials.encode()).decode())
    try:
        with urllib.request.urlopen(request, timeout=120) as reply:
            return int(reply.status)
    except urllib.error.HTTPError as refused:
        return refused.code


@pytest.mark.parametrize("credentials", [None, "planetpose:wrong-password", CREDENTIALS])
def test_without_the_password_nothing_but_health_is_answered(on: Stage, credentials: str | None) -> None:
    expected = 200 if credentials == CREDENTIALS else 401
    assert status_of(f"{on.installation.api_url}/version", credentials) == expected
    assert status_of(f"{on.installation.api_url}/health", credentials) == 200


def test_set_up_made_the_work_pool_the_deployments_and_the_automation(on: Stage) -> None:
    deployments = {entry["name"]: entry for entry in on.api.post("/deployments/filter", {})}
    assert {"nightly", "monthly", "images"} <= deployments.keys()
    monthly = deployments["monthly"]
    assert monthly["parameters"]["runner"] == "threads"  # from the environment
    assert monthly["schedules"][0]["schedule"]["cron"] == "0 6 1 * *"
    assert monthly["schedules"][0]["schedule"]["timezone"] == "UTC"
    assert monthly["work_pool_name"] == "planetpose"
    pools = on.api.post("/work_pools/filter", {})
    assert [(pool["name"], pool["type"], pool["concurrency_limit"]) for pool in pools] == [("planetpose", "process", 1)]
    assert [entry["name"] for entry in on.api.post("/automations/filter", {})] == ["planetpose-lost-runs"]


def test_a_schedule_fires_and_its_run_outlives_a_restart_of_the_database(on: Stage) -> None:
    place = "scheduled"
    on.api.schedule(DEPLOYMENT, EVERY_S, on.parameters(place))
    on.start_worker()
    wait_until("the first product", lambda: len(products(on.store(place))) > 0)
    assert on.api.runs_in("COMPLETED") == []
    on.postgres.stop()
    on.postgres.start()
    wait_until("the run's end", lambda: bool(on.api.runs_in("COMPLETED", "FAILED", "CRASHED")))
    assert {run["state_type"] for run in on.api.runs_in("COMPLETED", "FAILED", "CRASHED")} == {"COMPLETED"}
    assert on.sound(place) == IMAGES
    assert int(on.postgres.query("SELECT count(*) FROM flow_run WHERE state_type = 'COMPLETED'")) >= 1
