"""Functions compiled by numba, their machine code kept on disk."""

from collections.abc import Callable
from typing import Any


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile with numba and keep the machine code on disk, beside the source or in the user's cache folder; where
    neither can be written (a read-only container), compile anew in each process."""
    import numba

    try:
        return numba.njit(cache=True, nogil=True, error_model="numpy")(function)
    except RuntimeError:
        return numba.njit(nogil=True, error_model="numpy")(function)
