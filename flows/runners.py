"""Where a flow's tasks run: threads of its own process, or a Dask cluster of this machine or of many.

A runner is chosen by text: `threads`; `dask`, a cluster of processes on this machine for as long as the flow lasts;
`dask:ADDRESS`, the scheduler of a cluster that is there (`dask:tcp://host:8786`). All machines of a cluster must find
images, kernels, cache and store under the same paths, or share an object store. Both are Prefect's own task runners.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from catalog.errors import RefusedError
from tasks.quiet_dask import make_dask_quiet

if TYPE_CHECKING:
    from prefect.task_runners import TaskRunner

THREADS, DASK = "threads", "dask"
CONNECT_TIMEOUT_S = 30


@dataclass(frozen=True)
class Choice:
    """A runner's kind, `threads` or `dask`, and the scheduler's address, None for a cluster of this machine."""

    kind: str
    address: str | None = None


def parse_choice(text: str) -> Choice:
    """What the text chooses. Raises RefusedError when it names no runner."""
    kind, colon, address = text.partition(":")
    if (kind == THREADS and not colon) or (kind == DASK and bool(colon) == bool(address)):
        return Choice(kind, address or None)
    raise RefusedError(
        "unknown-runner", f"there is no runner {text!r}.", "Use threads, dask, or dask:ADDRESS of a scheduler."
    )


def task_runner(text: str, workers: int) -> "TaskRunner[Any]":
    """The task runner that `text` chooses.

    workers: tasks at a time, and processes of a cluster that is made here; a cluster that is there has its own number.
    Raises RefusedError when `text` names no runner, Dask is not installed or no scheduler answers.
    """
    choice = parse_choice(text)
    if choice.kind == THREADS:
        from prefect.task_runners import ThreadPoolTaskRunner

        return ThreadPoolTaskRunner(max_workers=max(workers, 1))
    return _dask_runner(choice.address, max(workers, 1))


def _dask_runner(address: str | None, workers: int) -> "TaskRunner[Any]":
    try:
        from prefect_dask import DaskTaskRunner
    except ImportError as error:
        raise RefusedError(
            "dask-missing", "prefect-dask is not installed.", "pip install 'planetpose[dask]'"
        ) from error
    if address:
        _check_scheduler(address)
        return DaskTaskRunner(address=address)
    make_dask_quiet()
    # One thread per process, as the workers of deploy/ have it. No dashboard: it would open a port to other machines.
    cluster = {"n_workers": workers, "threads_per_worker": 1, "processes": True, "dashboard_address": None}
    return DaskTaskRunner(cluster_kwargs=cluster)


def _check_scheduler(address: str) -> None:
    """Raises RefusedError when no scheduler answers; Dask itself would try for long, and then fail obscurely."""
    from distributed import Client

    try:
        with Client(address, timeout=CONNECT_TIMEOUT_S, set_as_default=False):
            return
    except (OSError, ValueError) as error:
        raise RefusedError(
            "scheduler-unreachable",
            f"no Dask scheduler answers at {address} ({error}).",
            "Check the address, or use --runner dask.",
        ) from error
