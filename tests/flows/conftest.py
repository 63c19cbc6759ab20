"""Fixtures of the flow tests: small fake steps, and one real Prefect server for the whole session."""

import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))  # the fake steps are named by module, as real ones are


@pytest.fixture(scope="session")
def server_state(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """State folder with a running server, shared by all workers of the test run."""
    shared = tmp_path_factory.getbasetemp()
    under_xdist = "PYTEST_XDIST_WORKER" in os.environ
    state = (shared.parent if under_xdist else shared) / "server-state"
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PLANETPOSE_STATE", str(state))
        patch.setenv("PLANETPOSE_SERVER_IDLE_MINUTES", "3")
        patch.delenv("PREFECT_API_URL", raising=False)
        patch.delenv("PREFECT_HOME", raising=False)
        from local_server.server import in_use, server_files, stop_server

        with in_use(server_files()):  # or it goes to sleep while this process is busy with other tests
            yield state
        if not under_xdist:  # another worker may still use it; it stops by itself soon after
            stop_server(server_files())


@pytest.fixture(scope="session")
def prefect_api(server_state: Path) -> Iterator[str]:
    """A real Prefect server, and this process's Prefect pointed to it."""
    from local_server.prefect_settings import prepare

    assert server_state
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PREFECT_API_URL", "")
        prepare("local")
        url = os.environ["PREFECT_API_URL"]
        from prefect.settings import (
            PREFECT_API_AUTH_STRING,
            PREFECT_API_URL,
            PREFECT_FLOWS_HEARTBEAT_FREQUENCY,
            temporary_settings,
        )

        credentials = os.environ["PREFECT_API_AUTH_STRING"]
        own = {PREFECT_API_URL: url, PREFECT_API_AUTH_STRING: credentials, PREFECT_FLOWS_HEARTBEAT_FREQUENCY: None}
        with temporary_settings(own):
            yield url
            from prefect.events.worker import EventsWorker
            from prefect.logging.handlers import APILogWorker

            for worker in (EventsWorker, APILogWorker):  # what they hold would be sent to a stopped server at exit
                worker.drain_all(timeout=10)


@pytest.fixture
def work_log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """File that every fake step that really works adds a line to."""
    log = tmp_path / "work.log"
    log.touch()
    monkeypatch.setenv("FAKE_STEPS_LOG", str(log))
    return log


@pytest.fixture
def plain_environment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """No kernels, an own cache and store."""
    monkeypatch.setenv("PLANETPOSE_KERNELS", "")
    monkeypatch.setenv("PLANETPOSE_CACHE", str(tmp_path / "cache"))
    return {"cache": tmp_path / "cache", "store": tmp_path / "out"}
