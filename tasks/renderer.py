"""Mitsuba, loaded once, quiet, in the variant that every machine can run."""

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


def mitsuba() -> Any:
    """The module."""
    with _LOADING:
        return _loaded()


def rendered(scene: Any) -> NDArray[np.float32]:
    """What the scene's sensor sees, (ny, nx, channels), one rendering at a time (each uses all processors).

    Raises FailedError when Ctrl-C cut the rendering short: the picture is not whole then.
    """
    with _RENDERING:
        picture = np.asarray(mitsuba().render(scene), dtype=np.float32)
        if scene.integrator().should_stop():
            raise FailedError(
                Reason.INTERRUPTED, "the rendering was interrupted.", "Run it again: finished steps stay."
            )
    return picture


@cache
def _loaded() -> Any:
    import mitsuba as mi

    mi.set_variant(VARIANT)
    mi.set_log_level(mi.LogLevel.Error)
    return mi
