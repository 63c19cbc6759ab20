"""The cached step: point."""

from typing import Any

from tasks.correcting import run_correction
from tasks.point import PointSettings, find_pointing
from tasks.work import Work


def run(work: Work) -> dict[str, Any]:
    """See `find_pointing`."""
    return run_correction(work, find_pointing, PointSettings.model_validate(work.inputs["settings"]))
