"""Functions compiled by numba, their machine code kept on disk."""

from collections.abc import Callable
from typing import Any

# What may be done to floating-point sums and quotients where the last digits do not matter; NaN and inf stay what they
# are.
REORDERED = {"reassoc", "contract", "arcp", "nsz"}


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile with numba and keep the machine code on disk, beside the source or in the user's cache folder; where
    neither can be written (a read-only container), compile anew in each process."""
    return _compiled(function)


def compiled_reordered(function: Callable[..., Any]) -> Callable[..., Any]:
    """The same, with arithmetic that may be reordered for speed."""
    return _compiled(function, fastmath=REORDERED)


def _compiled(function: Callable[..., Any], **options: Any) -> Callable[..., Any]:
    import numba

    try:
        return numba.njit(cache=True, nogil=True, error_model="numpy", **options)(function)
    except RuntimeError:
        return numba.njit(nogil=True, error_model="numpy", **options)(function)
