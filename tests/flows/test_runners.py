"""Where a flow's tasks run: threads, or processes of a Dask cluster that come and go."""

import os
from pathlib import Path

import pytest

from catalog.errors import RefusedError
from flows.runners import Choice, parse_choice, task_runner


@pytest.mark.parametrize(
    ("text", "choice"),
    [
        ("threads", Choice("threads")),
        ("dask", Choice("dask")),
        ("dask:tcp://host:8786", Choice("dask", "tcp://host:8786")),
        ("dask:host:8786", Choice("dask", "host:8786")),
    ],
)
def test_a_runner_is_chosen_by_text(text: str, choice: Choice) -> None:
    assert parse_choice(text) == choice


@pytest.mark.parametrize("text", ["", "dask:", "threads:", "threads:4", "Dask", "processes", "dasktcp://host"])
def test_what_names_no_runner_is_refused_with_what_does(text: str) -> None:
    with pytest.raises(RefusedError, match="dask:ADDRESS"):
        parse_choice(text)


def test_a_scheduler_that_does_not_answer_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    from flows import runners
    from local_server.server import free_port

    monkeypatch.setattr(runners, "CONNECT_TIMEOUT_S", 0.5)
    with pytest.raises(RefusedError, match="no Dask scheduler answers at tcp:"):
        task_runner(f"dask:tcp://127.0.0.1:{free_port()}", 1)


def test_images_of_a_killed_dask_worker_are_done_by_another_one(
    prefect_api: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two worker processes; the first image kills the one that does it, the first time."""
    monkeypatch.syspath_prepend(str(Path(__file__).parent))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(Path(__file__).parent), os.environ.get("PYTHONPATH", "")]))
    from dask_work import done_by
    from prefect import flow

    @flow
    def fan_out() -> list[int]:
        with task_runner("dask", 2) as runner:
            futures = [
                runner.submit(done_by, {"number": number, "grave": str(tmp_path / "grave")}) for number in range(6)
            ]
            return [future.result() for future in futures]

    workers = fan_out()
    killed = int((tmp_path / "grave").read_text())
    assert len(workers) == 6
    assert os.getpid() not in workers
    assert killed not in workers[:1]
    with pytest.raises(ProcessLookupError):
        os.kill(killed, 0)
