"""What every runner can do."""

from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, Protocol


class Runner(Protocol):
    """Takes work and gives futures for `concurrent.futures.wait`."""

    @property
    def shares_memory(self) -> bool:
        """Whether the work runs in this process: it then sees its context variables, and what it gets need not be
        pickled."""

    def images_at_a_time(self) -> int:
        """How many images are worked on at once; of a cluster that grows or shrinks, now."""

    def submit(self, name: str, work: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Have `work(*arguments)` done, and called `name` where runs are seen.

        On a cluster `work` is a function of a module, and arguments and result are pickled. The future raises what the
        work raised; when a worker process dies, its work is done again by another one.
        """
