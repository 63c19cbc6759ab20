"""Where images are worked on: threads of this process, or the processes of a Dask cluster, on this machine or many.

A runner is chosen by text: `threads`; `dask`, a cluster of processes on this machine for as long as the flow lasts;
`dask:ADDRESS`, the scheduler of a cluster that is there (`dask:tcp://host:8786`). All machines must find images,
kernels, cache and store under the same paths.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from catalog.errors import RefusedError
from flows.runners.base import Runner

THREADS, DASK = "threads", "dask"


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


@contextmanager
def open_runner(text: str, workers: int) -> Iterator[Runner]:
    """The runner that `text` chooses, within a flow, for as long as the `with` block lasts.

    workers: images at a time; of a cluster that is there the cluster says it. Raises RefusedError when `text` names no
    runner, the scheduler does not answer, or Dask is not installed.
    """
    choice = parse_choice(text)
    if choice.kind == THREADS:
        from flows.runners.threads import threads_runner

        with threads_runner(workers) as runner:
            yield runner
    else:
        from flows.runners.dask import dask_runner

        with dask_runner(choice.address, workers) as on_dask:
            yield on_dask
