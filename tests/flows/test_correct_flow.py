"""The Prefect flow on small fake steps: what is done again and what is not, and what one bad image does to others."""

import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from fake_steps import DOUBLE, PUBLISH, READ, DoubleInputs, ImageFile, PublishInputs, ReadInputs, done

from flows.chain import Chain
from flows.progress import Silent
from flows.request import Request
from flows.run import run_requests
from tasks.guidance.prefect_run import noted_run
from tasks.publish.index import LOCK
from tasks.work import NoFiles

CHAIN = ("read", "double-1", "double-2", "publish")
SETTINGS = {"double-1": 1.0, "double-2": 1.0}

Run = Callable[..., list[dict[str, Any]]]


def fake_chain(chain: Chain) -> None:
    """read -> double -> double -> publish."""
    from catalog.digest import sha256_of_file

    image = chain.request.image
    latest = chain.do(READ, ReadInputs(image=sha256_of_file(image)), ImageFile(image))
    for number in (1, 2):
        setting = SETTINGS[f"double-{number}"]
        inputs = DoubleInputs(before=latest.key, number=latest.result.number, setting=setting)
        latest = chain.do(DOUBLE, inputs, NoFiles(), number=number)
    chain.do(PUBLISH, PublishInputs(before=latest.key), NoFiles(), destination=chain.request.product_folder)


@pytest.fixture
def run(prefect_api: str, plain_environment: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> Run:
    """Run images through the real flow with the fake chain; results as `--json` prints them."""
    for module in ("flows.one_image",):
        monkeypatch.setattr(f"{module}.correct_image", fake_chain)
    monkeypatch.setattr("flows.result.known_before_correction", lambda chain: {})
    monkeypatch.setattr("flows.result.corrected", lambda chain: {"cube": str(chain.done["publish"].folder)})

    def run_images(*images: Path, **changes: Any) -> list[dict[str, Any]]:
        reported: list[dict[str, Any]] = []
        requests = [Request(**({"image": image, **plain_environment} | changes)) for image in images]
        results = run_requests(requests, prefect_api, 2, Silent(), reported.append)
        assert reported == results
        return results

    return run_images


@pytest.fixture
def image(tmp_path: Path) -> Callable[[str, str], Path]:
    def write(name: str, text: str) -> Path:
        path = tmp_path / f"{name}.txt"
        path.write_text(text)
        return path

    return write


def test_a_second_run_does_no_step_and_says_so(run: Run, image: Callable[[str, str], Path], work_log: Path) -> None:
    file = image("seven", "7")
    first = run(file)[0]
    assert (first["status"], first["cached"], tuple(first["seconds"])) == ("ok", [], CHAIN)
    assert done(work_log) == ["read", "double", "double", "publish"]
    second = run(file)[0]
    assert (second["status"], tuple(second["cached"])) == ("ok", CHAIN)
    assert done(work_log) == []
    assert second | {"cached": []} == first


def test_changing_one_setting_redoes_that_step_and_what_follows(
    run: Run, image: Callable[[str, str], Path], work_log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = image("seven", "7")
    run(file)
    done(work_log)
    monkeypatch.setitem(SETTINGS, "double-2", 3.0)
    assert run(file)[0]["cached"] == ["read", "double-1"]
    assert done(work_log) == ["double", "publish"]
    monkeypatch.setitem(SETTINGS, "double-2", 1.0)
    again = run(file)[0]  # back: only the product itself must be made again
    assert again["cached"] == ["read", "double-1", "double-2"]
    assert done(work_log) == ["publish"]


@pytest.mark.parametrize("lost", CHAIN[:3])
def test_deleting_one_result_redoes_only_that_step(
    run: Run, image: Callable[[str, str], Path], work_log: Path, plain_environment: dict[str, Any], lost: str
) -> None:
    from flows.chain import only_cached

    file = image("seven", "7")
    run(file)
    done(work_log)
    chain = Chain(Request(image=file, **plain_environment), only_cached)
    fake_chain(chain)
    shutil.rmtree(chain.done[lost].folder)
    assert run(file)[0]["cached"] == [name for name in CHAIN if name != lost]
    assert done(work_log) == [lost.partition("-")[0]]


def test_deleting_only_the_record_redoes_the_step_although_prefect_remembers_it(
    run: Run, image: Callable[[str, str], Path], work_log: Path, plain_environment: dict[str, Any]
) -> None:
    file = image("seven", "7")
    run(file)
    done(work_log)
    for record in (plain_environment["cache"] / "double").rglob("record.json"):
        record.unlink()
    assert run(file)[0]["status"] == "ok"
    assert done(work_log) == ["double", "double"]


def test_a_product_in_another_store_is_published_there_too(
    run: Run, image: Callable[[str, str], Path], work_log: Path, tmp_path: Path
) -> None:
    file = image("seven", "7")
    run(file)
    done(work_log)
    other = run(file, store=tmp_path / "other")[0]
    assert other["cached"] == ["read", "double-1", "double-2"]
    assert (tmp_path / "other" / "seven" / "product.txt").read_text() == "whole"
    assert done(work_log) == ["publish"]
    assert tuple(run(file)[0]["cached"]) == CHAIN  # the first store's is still good


def test_the_same_content_under_another_name_is_another_product_of_cached_steps(
    run: Run, image: Callable[[str, str], Path], work_log: Path
) -> None:
    run(image("seven", "7"))
    done(work_log)
    assert run(image("copy", "7"))[0]["cached"] == ["read", "double-1", "double-2"]
    assert done(work_log) == ["publish"]


def test_one_bad_image_does_not_stop_the_others_and_results_come_in_order(
    run: Run, image: Callable[[str, str], Path], work_log: Path, plain_environment: dict[str, Any]
) -> None:
    texts = {"good": "7", "text": "refuse", "loop": "fail", "surprise": "bug", "full": "disk", "fine": "8"}
    results = run(*(image(name, text) for name, text in texts.items()))
    assert [result["product"] for result in results] == list(texts)
    assert [result["status"] for result in results] == ["ok", "refused", "failed", "failed", "failed", "ok"]
    reasons = {result["product"]: result["reason"] for result in results}
    assert reasons["good"] is None
    assert reasons["text"].startswith("no-number: image ")
    assert reasons["text"].endswith("Write one.")
    assert reasons["loop"] == "did-not-converge: it went round in circles."
    assert reasons["surprise"].startswith("bug: ZeroDivisionError: nobody thought of this")
    assert reasons["full"].startswith("file-trouble:")
    assert "No space left" in reasons["full"]
    assert {path.name for path in plain_environment["store"].iterdir()} - {LOCK} == {"fine", "good"}
    assert len(done(work_log)) == 12


def test_an_image_that_is_refused_leaves_nothing_in_the_store(
    run: Run, image: Callable[[str, str], Path], work_log: Path, plain_environment: dict[str, Any]
) -> None:
    result = run(image("text", "refuse"))[0]
    assert (result["status"], result["cube"], result["cached"]) == ("refused", None, [])
    assert not plain_environment["store"].exists()
    assert done(work_log) == ["read"]


def test_two_images_that_would_become_one_product_are_kept_apart(run: Run, tmp_path: Path, work_log: Path) -> None:
    paths = [tmp_path / folder / "same.txt" for folder in ("a", "b")]
    for number, path in enumerate(paths):
        path.parent.mkdir()
        path.write_text(str(number))
    for _ in range(2):  # also when the first one is cached
        results = run(*paths)
        assert [result["status"] for result in results] == ["ok", "refused"]
        assert results[1]["reason"].startswith("product-twice:")
    assert done(work_log) == ["read", "double", "double", "publish"]


def test_prefect_shows_every_step_as_a_task_and_the_second_time_as_cached(
    run: Run, image: Callable[[str, str], Path], work_log: Path, prefect_api: str, plain_environment: dict[str, Any]
) -> None:
    import time

    from prefect.client.orchestration import get_client
    from prefect.client.schemas.filters import TaskRunFilter, TaskRunFilterName

    file = image("shown", "41")
    run(file)
    store = plain_environment["store"]
    shutil.rmtree(store)  # so that there is work, and the flow runs again
    (store / ".requests").mkdir(parents=True)  # as real steps leave it
    run(file)
    noted = noted_run(store, "shown") or {}
    names = [f"{step}:shown" for step in CHAIN]
    expected = [(name, state) for name in names[:3] for state in ("Cached", "Completed")]
    expected = sorted([*expected, (names[3], "Completed"), (names[3], "Completed")])
    deadline = time.monotonic() + 300
    states: list[tuple[str, str]] = []
    with get_client(sync_client=True) as client:
        while states != expected and time.monotonic() < deadline:  # the server records runs, and their ends, later
            found = client.read_task_runs(task_run_filter=TaskRunFilter(name=TaskRunFilterName(any_=names)))
            states = sorted((task.name, str(task.state_name)) for task in found)
            time.sleep(0.2)
        assert client.read_flow_run(noted["flow_run"]).name in noted["name"]
    assert noted["url"].endswith(f"/runs/flow-run/{noted['flow_run']}")
    assert states == expected
    assert done(work_log) == ["read", "double", "double", "publish", "publish"]


def test_a_server_that_does_not_answer_gives_every_image_a_result(
    run: Run, image: Callable[[str, str], Path], work_log: Path, monkeypatch: pytest.MonkeyPatch,
    plain_environment: dict[str, Any],
) -> None:  # fmt: skip
    from local_server.server import free_port

    nowhere = f"http://127.0.0.1:{free_port()}/api"
    from prefect.settings import PREFECT_API_URL, temporary_settings

    reported: list[dict[str, Any]] = []
    with temporary_settings({PREFECT_API_URL: nowhere}):
        requests = [Request(image=image("seven", "7"), **plain_environment)]
        results = run_requests(requests, nowhere, 1, Silent(), reported.append)
    assert [result["status"] for result in results] == ["failed"]
    assert results[0]["reason"].startswith("prefect: ")
    assert reported == results
    assert done(work_log) == []


def test_an_interrupted_batch_stops_at_the_next_iteration_and_begins_no_other_image(
    image: Callable[[str, str], Path],
    work_log: Path,
    plain_environment: dict[str, Any],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    from concurrent.futures import ThreadPoolExecutor
    from threading import Event

    from flows import correct as module
    from tasks.step import run as run_plainly

    monkeypatch.setattr("flows.one_image.correct_image", fake_chain)
    monkeypatch.setattr("flows.result.known_before_correction", lambda chain: {})
    requests = [Request(image=image(name, name), **plain_environment) for name in ("1", "2", "3")]
    at_work, stop, reported = Event(), Event(), []

    class Interrupting(Silent):
        def message(self, product: str, step: str, iteration: int, text: str) -> None:
            if iteration:  # in the middle of double-1 of the first image
                at_work.set()
                stop.wait(300)

        def finished(self, product: str, status: str, reason: str | None) -> None:
            reported.append((product, status, reason))

    def interrupted_batch() -> None:
        with ThreadPoolExecutor(1) as pool, module.stopping(pool, stop):
            for request in requests:
                pool.submit(module.one_result, request, Interrupting(), None, stop, run_plainly)
            assert at_work.wait(300)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted_batch()
    assert [(product, status) for product, status, _ in reported] == [("1", "failed")]
    assert str(reported[0][2]).startswith("interrupted:")
    assert done(work_log) == ["read", "double"]  # the step at work ends, the next one does not begin


def test_ctrl_c_that_only_a_rendering_hears_ends_the_batch_as_well(
    image: Callable[[str, str], Path], plain_environment: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Mitsuba takes the signal while it renders; whether it also reaches the waiting thread is chance."""
    from concurrent.futures import ThreadPoolExecutor
    from threading import Event

    from catalog.errors import FailedError
    from flows import correct as module
    from tasks.step import run as run_plainly

    begun, reported, first_ends = [], [], Event()

    class Listening(Silent):
        def finished(self, product: str, status: str, reason: str | None) -> None:
            reported.append((product, str(reason)))

    def chain_of(chain: Any) -> None:
        begun.append(chain.request.product)
        if chain.request.product == "1":
            first_ends.wait(300)
        raise FailedError("interrupted", "the rendering was interrupted.", "Run it again: finished steps stay.")

    monkeypatch.setattr("flows.one_image.correct_image", chain_of)
    monkeypatch.setattr("flows.result.known_before_correction", lambda chain: {})
    requests = [Request(image=image(name, name), **plain_environment) for name in ("1", "2")]
    stop = Event()

    def batch() -> None:
        with ThreadPoolExecutor(2) as pool, module.stopping(pool, stop):
            try:
                futures = [
                    pool.submit(module.one_result, r, Listening(), None, stop, run_plainly) for r in requests[:2]
                ]
                module.awaited(futures[0], stop)  # which is still at work; the second one's rendering was cut short
            finally:
                first_ends.set()

    with pytest.raises(KeyboardInterrupt):
        batch()
    assert sorted(begun) == ["1", "2"]
    assert [reason.partition(":")[0] for _, reason in reported] == ["interrupted", "interrupted"]


def test_ctrl_c_is_heard_at_once_after_mitsuba_gave_the_signal_back_as_one_that_wakes_nobody() -> None:
    """As C's `signal` does: interrupted waits go on. Not so a wait of `awaited`, which ends by itself."""
    heard = subprocess.run([sys.executable, "-c", CTRL_C], capture_output=True, text=True, timeout=300, check=True)
    assert heard.stdout == "heard"


CTRL_C = """
import os, signal, threading
from concurrent.futures import Future, wait
from flows import correct
future, waiting = Future(), threading.Event()

def watched(futures, timeout):
    waiting.set()
    return wait(futures, timeout)

def ctrl_c():
    waiting.wait()
    os.kill(os.getpid(), signal.SIGINT)

correct.wait = watched
signal.signal(signal.SIGINT, signal.default_int_handler)
signal.siginterrupt(signal.SIGINT, False)
threading.Thread(target=ctrl_c, daemon=True).start()
try:
    correct.awaited(future, threading.Event())  # the image never ends
except KeyboardInterrupt:
    print("heard", end="", flush=True)
os._exit(0)
"""
