"""Mitsuba, loaded once, quiet, in the variant that every machine can run."""

from functools import cache
from threading import Lock
from typing import Any

VARIANT = "scalar_rgb"  # autodetecting a variant may abort the process where LLVM is missing
# Its import swaps modules under way: a second thread would get one that is not ready.
_LOADING = Lock()


def mitsuba() -> Any:
    """The module."""
    with _LOADING:
        return _loaded()


@cache
def _loaded() -> Any:
    import mitsuba as mi

    mi.set_variant(VARIANT)
    mi.set_log_level(mi.LogLevel.Error)
    return mi
