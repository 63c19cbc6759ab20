"""The Prefect flow: correct images, each through the chain of cached tasks; one bad image never stops the others."""

import os
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from contextvars import copy_context
from threading import Event

from prefect import flow, get_run_logger
from prefect.states import Completed, Failed, State

from flows.flow import flow_of
from flows.flow_run import current_run
from flows.one_image import Result, one_result, twins
from flows.options import CorrectOptions
from flows.progress import audience
from flows.request import Request
from flows.requests import requests_of_files
from flows.result import tally
from tasks.boundary import PUBLISHED
from tasks.guidance.prefect_run import note_run
from tasks.objectstore.places import Indexing
from tasks.prefect_task import run_as_task

HEAR_CTRL_C_S = 0.5


class ImagesNotOkError(Exception):
    """Some images failed or were refused; the others are published."""


@flow_of(CorrectOptions)
def correct(options: CorrectOptions) -> State[list[Result]]:
    """Correct every image, some at a time; the flow fails, after all are done, when one is not ok. Raises RefusedError
    when the options are no good."""
    requests = requests_of_files(options)
    return correct_all(requests, options.workers or min(len(requests), os.cpu_count() or 1))


@flow(name="correct-requests", persist_result=False)
def correct_requests(requests: list[Request], workers: int = 1) -> State[list[Result]]:
    """The same with requests of which each has options of its own."""
    return correct_all(requests, workers)


def correct_all(requests: list[Request], workers: int) -> State[list[Result]]:
    """Correct images in threads of this process: the heavy parts (Mitsuba, numpy, OpenCV) release the interpreter's
    lock. Results are reported in the order of the requests."""
    listener, run_logger, run = audience(), get_run_logger(), current_run()
    refused, stop = twins(requests), Event()
    results: list[Result] = []
    threads = ThreadPoolExecutor(max_workers=max(workers, 1), thread_name_prefix="image")
    with Indexing() as indexing, threads as pool, stopping(pool, stop):
        # Each thread gets a copy of the flow's context: its tasks belong to this flow run.
        futures = [
            pool.submit(
                copy_context().run, one_result, request, listener.reporter, refused.get(position), stop, run_as_task
            )
            for position, request in enumerate(requests)
        ]
        for future in futures:
            result = awaited(future, stop)
            results.append(result)
            indexing.note(requests[len(results) - 1].store, result)
            note_run(requests[len(results) - 1].store, result["product"], run)
            listener.on_result(result)
            run_logger.info("%s: %s %s", result["product"], result["status"], result["reason"] or "")
    bad = [result for result in results if result["status"] not in PUBLISHED]
    summary = tally(results)
    return Failed(message=summary, data=ImagesNotOkError(summary)) if bad else Completed(message=summary, data=results)


def awaited(future: "Future[Result]", stop: Event) -> Result:
    """The result, once it is there. Waits in short turns: after a rendering Mitsuba gives SIGINT back as one that wakes
    nobody, and Ctrl-C would only be heard at an image's end. Raises KeyboardInterrupt when `stop` is set: then Ctrl-C
    reached the rendering of some image, and perhaps nobody else."""
    while not (future.done() or stop.is_set()):
        wait([future], timeout=HEAR_CTRL_C_S)
    if stop.is_set():
        raise KeyboardInterrupt
    return future.result()


@contextmanager
def stopping(pool: ThreadPoolExecutor, stop: Event) -> Iterator[None]:
    """When the `with` block is interrupted, images at work stop at their next iteration, and others are not begun."""
    try:
        yield
    except BaseException:
        stop.set()
        pool.shutdown(wait=False, cancel_futures=True)
        raise
