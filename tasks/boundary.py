"""The boundary of one image or product: whatever goes wrong with it is reported as its own, and the others go on."""

import logging
from collections.abc import Callable
from errno import EROFS
from pathlib import Path

from catalog.errors import PlanetposeError
from catalog.plain_text import printable
from catalog.settings import ways_out_of
from tasks.atomic import without_temporaries

PUBLISHED = ("ok", "doubtful")  # statuses of images that have a product
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


def status_of(error: Exception) -> str:
    """`refused` or `failed`."""
    return error.status if isinstance(error, PlanetposeError) else "failed"


def reason_of(error: Exception) -> str:
    """Code, fault and remedy. What is no expected failure is named as what it is: trouble with files, or a bug."""
    if isinstance(error, PlanetposeError):
        return error.reason
    if isinstance(error, OSError):
        return file_trouble(error)
    return f"bug: {type(error).__name__}: {printable(str(error))}. Please report it with the log."


def file_trouble(error: OSError) -> str:
    """Reason of a file that could not be read or written."""
    variables = ways_out_of(Path(error.filename)) if isinstance(error.filename, str) else []
    if variables:
        remedy = f"Set {' and '.join(variables)} to what can be written in."
        return f"file-trouble: {without_temporaries(str(error))}. {remedy}"
    forbidden = isinstance(error, PermissionError) or error.errno == EROFS
    remedy = "Change its permissions, or name another place" if forbidden else "Check disk and path, and try again"
    return f"file-trouble: {printable(without_temporaries(str(error)))}. {remedy}."
