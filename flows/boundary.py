"""The boundary of one image or product: whatever goes wrong with it is told as its own, and the others go on."""

import logging
from collections.abc import Callable
from typing import TypeVar

from catalog.errors import PlanetposeError
from flows.result import verdict

Answer = TypeVar("Answer")
logger = logging.getLogger("planetpose")


def attempted(work: Callable[[], Answer], name: str, log: bool = True) -> tuple[Answer, None] | tuple[None, Exception]:
    """What `work` returns, or what it raised. log: write the traceback of what is no expected failure into the log."""
    try:
        return work(), None
    except (PlanetposeError, OSError) as expected:
        return None, expected
    except Exception as bug:  # the log has the traceback
        if log:
            logger.exception("%s ended by %s", name, type(bug).__name__)
        return None, bug


def reason_of(error: Exception) -> str:
    """What is told of `error`: code, fault and remedy."""
    return str(verdict(error, [])["reason"])
