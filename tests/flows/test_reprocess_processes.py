"""The processes that images are done in: what a hang, a death and a large image come to, and what is left of them."""

import errno
import json
import threading
from pathlib import Path
from typing import Any

import pytest

from catalog.errors import FailedError, RefusedError
from flows.options import ReprocessOptions
from flows.reprocessing.pool import LostError, Worker
from flows.reprocessing.worker import can_pass, claimed, sweep_claims
from lab.faults.processes import runs

LIMITS = {"image_timeout_s": 120.0, "image_memory_mb": 6000.0}


def said(_: Any) -> None:
    """Nobody listens."""


@pytest.fixture
def worker() -> Any:
    import fake_worker  # beside this file, where the worker finds it too

    one = Worker(target=fake_worker.work)
    yield one
    one.kill()


def test_one_process_does_one_image_after_the_other(worker: Worker) -> None:
    assert [worker.do({"do": "end"} | LIMITS, said)["pid"] for _ in range(3)] == [worker.pid] * 3


def test_a_hung_step_is_ended_and_leaves_nothing(worker: Worker, tmp_path: Path) -> None:
    worker.do({"do": "end"} | LIMITS, said)  # its start, which may take long on a busy machine, is over
    job = {"do": "hang", "folder": str(tmp_path / "kind"), "started": str(tmp_path / "started")}
    with pytest.raises(LostError, match="timed-out: step point-1 was at work"):
        worker.do(LIMITS | job | {"image_timeout_s": 3.0}, said)
    assert (tmp_path / "started").exists()
    assert not runs(worker.pid)
    assert list((tmp_path / "kind").iterdir()) == []


def test_a_process_that_dies_is_reported_with_its_step_and_how(worker: Worker) -> None:
    with pytest.raises(LostError, match=r"worker-died: the process died in step point-1 \(exit status 3\)"):
        worker.do({"do": "die"} | LIMITS, said)


def test_an_image_that_takes_too_much_memory_is_ended(worker: Worker) -> None:
    with pytest.raises(LostError, match="memory: step point-1 took"):
        worker.do({"do": "grow"} | LIMITS | {"image_memory_mb": 200.0}, said)
    assert not runs(worker.pid)


def raised_from(error: Exception, cause: Exception) -> Exception:
    error.__cause__ = cause
    return error


@pytest.mark.parametrize(
    ("error", "passes"),
    [
        (OSError(errno.ENOSPC, "No space left on device"), True),
        (FileNotFoundError("a step's folder was pruned"), True),
        (MemoryError(), True),
        (ZeroDivisionError(), False),
        (RefusedError("image-missing", "there is none."), False),
        (FailedError("limb-not-measured", "no limb."), False),
        (raised_from(RefusedError("image-missing", "gone."), FileNotFoundError(errno.ENOENT, "no")), False),
        (raised_from(RefusedError("image-unreadable", "broken."), OSError(errno.EIO, "Input/output error")), True),
        (raised_from(RefusedError("image-unreadable", "broken."), OSError(errno.ESTALE, "Stale handle")), True),
        (raised_from(FailedError("store-unreachable", "no net."), ConnectionError("refused")), True),
        (raised_from(ValueError("half a file"), OSError(errno.EIO, "Input/output error")), True),
    ],
)
def test_trouble_of_disks_and_networks_can_pass_and_what_an_image_is_like_cannot(
    error: Exception, passes: bool
) -> None:
    assert can_pass(error) is passes


def test_two_at_once_take_turns_and_the_claim_is_gone_afterwards(tmp_path: Path) -> None:
    order: list[str] = []
    waited = threading.Event()

    def second() -> None:
        with claimed(tmp_path, "image", waited.set):
            order.append("second")

    with claimed(tmp_path, "image", said):  # type: ignore[arg-type]
        thread = threading.Thread(target=second)
        thread.start()
        assert waited.wait(60)
        order.append("first")
    thread.join(60)
    assert order == ["first", "second"]
    assert not list(tmp_path.rglob("*.lock"))


def test_claims_of_the_dead_are_swept_and_those_of_the_living_are_not(tmp_path: Path) -> None:
    with claimed(tmp_path, "living", lambda: None):
        abandoned = next(tmp_path.rglob("living.lock")).with_name("dead.lock")
        abandoned.touch()
        assert sweep_claims(tmp_path) == 1
        assert [path.name for path in tmp_path.rglob("*.lock")] == ["living.lock"]


@pytest.mark.parametrize(("fault", "attempts"), [("passing", 3), ("refused", 1)])
def test_prefect_tries_again_only_after_faults_that_can_pass(
    prefect_api: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fault: str, attempts: int
) -> None:
    from types import SimpleNamespace

    from prefect import flow

    from flows.reprocessing import image_task

    seen: list[str] = []

    def ended(*_: Any) -> Any:
        seen.append(fault)
        return SimpleNamespace(passing=fault == "passing", status="refused", reason=f"{fault}: reported.")

    monkeypatch.setattr(image_task, "do_image", ended)
    task = image_task.image_task(ReprocessOptions(images="list", retries=2, retry_delay_s=0))

    @flow
    def one_image() -> Any:
        return task("small", json.dumps({"request": {"store": str(tmp_path)}}), return_state=True)

    state = one_image(return_state=True)
    assert seen == [fault] * attempts
    assert state.is_failed()


def test_after_its_end_a_pool_begins_nothing_until_it_is_opened_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """An image that waits in the task runner's queue when the run is interrupted would else be done to its end."""
    from flows.reprocessing import pool as pools

    begun: list[int] = []

    class Begun:
        is_alive = True

        def __init__(self, threads: int) -> None:
            begun.append(threads)

        def do(self, *_: Any) -> dict[str, Any]:
            return {"kind": "end"}

        def end(self) -> None:
            self.is_alive = False

    monkeypatch.setattr(pools, "Worker", Begun)
    processes = pools.Pool()
    processes.close()
    with pytest.raises(LostError, match="interrupted"):
        processes.do(LIMITS, said)
    assert begun == []
    processes.open()
    assert processes.do({"threads": 3} | LIMITS, said) == {"kind": "end"}
    assert begun == [3]


def test_an_image_that_a_closed_pool_does_not_begin_leaves_no_outcome(tmp_path: Path) -> None:
    from flows.reprocessing.image_task import InterruptedRunError, do_image
    from flows.reprocessing.pool import Pool

    processes = Pool()
    processes.close()
    request = {"product": "one", "store": str(tmp_path)}
    with pytest.raises(InterruptedRunError):
        do_image({"request": request} | LIMITS, processes)
    assert list(tmp_path.rglob("*.json")) == []
