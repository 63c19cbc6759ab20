"""Work for Dask workers, named by module as real work is."""

import os
import signal
from pathlib import Path

from prefect import task
from prefect.cache_policies import NO_CACHE


@task(persist_result=False, cache_policy=NO_CACHE)
def done_by(number: int, grave: str) -> int:
    """The process that did it; number 0 kills its process once, which leaves its own number in the file `grave`."""
    if number == 0 and not Path(grave).exists():
        Path(grave).write_text(str(os.getpid()))
        os.kill(os.getpid(), signal.SIGKILL)
    return os.getpid()
