"""Mitsuba, loaded once, quiet, in the variant that every machine can run."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.errors import FailedError
from catalog.reasons import Reason

VARIANT = "scalar_rgb"  # autodetecting a variant may abort the process where LLVM is missing
# Its import swaps modules under way: a second thread would get one that is not ready.
_LOADING = Lock()
# Mitsuba takes SIGINT for the time of a rendering and then gives it back to whom it had it from. Two at once give it
# back to a rendering that is no more: Ctrl-C then ends the process by a segmentation fault, or does nothing.
_RENDERING = Lock()
# A picture of no more pixels is done by the calling thread alone: waking others, who then wait for more to do, costs
# half as much again (measured on pictures of 72 x 72).
FEW = 10_000


def mitsuba() -> Any:
    """The module."""
    with _LOADING:
        return _loaded()


def rendered(scene: Any) -> NDArray[np.float32]:
    """What the scene's sensor sees, (ny, nx, channels), one rendering at a time (each of more than FEW pixels uses
    all processors).

    Raises FailedError when Ctrl-C cut the rendering short: the picture is not whole then.
    """
    with _RENDERING:
        with _threads(scene):
            picture = np.asarray(mitsuba().render(scene), dtype=np.float32)
        if scene.integrator().should_stop():
            raise FailedError(
                Reason.INTERRUPTED, "the rendering was interrupted.", "Run it again: finished steps stay."
            )
    return picture


@contextmanager
def _threads(scene: Any) -> Iterator[None]:
    import drjit

    usual = drjit.thread_count()
    if np.prod(scene.sensors()[0].film().crop_size()) > FEW:
        yield
        return
    drjit.set_thread_count(0)
    try:
        yield
    finally:
        drjit.set_thread_count(usual)


@cache
def _loaded() -> Any:
    import mitsuba as mi

    mi.set_variant(VARIANT)
    mi.set_log_level(mi.LogLevel.Error)
    return mi
