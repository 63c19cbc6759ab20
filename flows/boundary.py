"""The boundary of one image or product: whatever goes wrong with it is told as its own, and the others go on."""

import logging
from collections.abc import Callable

from catalog.errors import PlanetposeError
from flows.result import verdict

logger = logging.getLogger("planetpose")


def trouble_of(work: Callable[[], object], name: str, log: bool = True) -> Exception | None:
    """What `work` raises, None when it comes to its end. log: write the traceback of what is no expected failure into
    the log."""
    try:
        work()
    except (PlanetposeError, OSError) as expected:
        return expected
    except Exception as bug:  # the log has the traceback
        if log:
            logger.exception("%s ended by %s", name, type(bug).__name__)
        return bug
    return None


def reason_of(error: Exception) -> str:
    """What is told of `error`: code, fault and remedy."""
    return str(verdict(error, [])["reason"])
