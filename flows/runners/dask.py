"""Processes of a Dask cluster, through prefect-dask: an image is one task of the flow run, its steps plain calls."""

from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Future
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from prefect import task
from prefect.cache_policies import NO_CACHE

from catalog.errors import RefusedError
from flows.runners.single_thread import single_thread_environment, use_one_thread

if TYPE_CHECKING:
    from prefect_dask import DaskTaskRunner
    from prefect_dask.task_runners import PrefectDaskFuture

CONNECT_TIMEOUT_S = 30


@task(name="image", task_run_name="{name}", persist_result=False, cache_policy=NO_CACHE)
def on_worker(name: str, work: Callable[..., Any], arguments: tuple[Any, ...]) -> Any:  # noqa: ARG001 - names the run
    """In a worker process: the work."""
    use_one_thread()
    return work(*arguments)


class DaskRunner:
    """See `flows.runners.base.Runner`."""

    shares_memory = False

    def __init__(self, runner: "DaskTaskRunner") -> None:
        self._runner = runner

    def images_at_a_time(self) -> int:
        """Threads of all workers, as the scheduler has them now."""
        return max(sum(self._runner.client.nthreads().values()), 1)

    def submit(self, name: str, work: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """As a task of the flow run, in whatever worker is free."""
        parameters = {"name": name, "work": work, "arguments": arguments}
        return _standard(self._runner.submit(on_worker, parameters=parameters))


def _standard(submitted: "PrefectDaskFuture[Any]") -> Future[Any]:
    """A Dask future as one that `concurrent.futures.wait` understands."""
    standard: Future[Any] = Future()
    standard.set_running_or_notify_cancel()

    def settle(_: object) -> None:
        try:
            standard.set_result(submitted.result())
        except (Exception, CancelledError) as error:  # whatever the work raised is for who asks the future
            standard.set_exception(error)

    submitted.wrapped_future.add_done_callback(settle)
    return standard


@contextmanager
def dask_runner(address: str | None, workers: int) -> Iterator[DaskRunner]:
    """A runner on the cluster at `address`, or on one of `workers` processes of this machine that ends with the block.

    Raises RefusedError when Dask is not installed or the scheduler does not answer.
    """
    try:
        from prefect_dask import DaskTaskRunner
    except ImportError as error:
        raise RefusedError(
            "dask-missing", "prefect-dask is not installed.", "pip install 'planetpose[dask]'"
        ) from error
    client = {"timeout": CONNECT_TIMEOUT_S}
    if address:
        runner = DaskTaskRunner(address=address, client_kwargs=client)
    else:
        cluster = {
            "n_workers": max(workers, 1),
            "threads_per_worker": 1,
            "processes": True,
            "dashboard_address": None,
            "env": single_thread_environment(),
        }
        runner = DaskTaskRunner(cluster_kwargs=cluster, client_kwargs=client)
    with runner:
        yield DaskRunner(_connected(runner, address))


def _connected(runner: "DaskTaskRunner", address: str | None) -> "DaskTaskRunner":
    try:
        _ = runner.client
    except OSError as error:
        fault = f"no Dask scheduler answers at {address}: {error}."
        raise RefusedError("scheduler-unreachable", fault, "Check the address; or use --runner dask.") from error
    return runner
