"""Which faults may be gone the next time: trouble of disks, networks and processes; never what an image is like."""

import errno

from catalog.errors import PlanetposeError

PASSING_ERRNOS = frozenset(
    getattr(errno, name)
    for name in (
        *("EIO", "ENOSPC", "EDQUOT", "EFBIG", "ENOMEM", "EMFILE", "ENFILE", "EAGAIN", "EINTR", "EBUSY", "ESTALE"),
        *(
            "ETIMEDOUT",
            "ECONNRESET",
            "ECONNREFUSED",
            "ECONNABORTED",
            "EHOSTUNREACH",
            "ENETUNREACH",
            "ENETDOWN",
            "EPIPE",
        ),
        *("ENOLCK", "EREMOTEIO", "EROFS"),
    )
    if hasattr(errno, name)
)


class PassingFaultError(Exception):
    """An image ended by a fault that may be gone the next time: Prefect's retries are for these."""


def can_pass(error: BaseException) -> bool:
    """Whether to try again: trouble with files or memory, also where it was told as a refusal of the file."""
    if isinstance(error, PlanetposeError):
        return any(isinstance(cause, MemoryError) or _is_passing_os_error(cause) for cause in causes(error))
    return any(isinstance(cause, OSError | MemoryError) for cause in [error, *causes(error)])


def causes(error: BaseException) -> list[BaseException]:
    """What `error` was raised from, the nearest first."""
    found: list[BaseException] = []
    cause = error.__cause__ or error.__context__
    while cause is not None and cause not in found:
        found.append(cause)
        cause = cause.__cause__ or cause.__context__
    return found


def _is_passing_os_error(error: BaseException) -> bool:
    return isinstance(error, ConnectionError | TimeoutError) or (
        isinstance(error, OSError) and error.errno in PASSING_ERRNOS
    )
