"""The cached step: range."""

from typing import Any

from tasks.correcting import run_correction
from tasks.range import RangeSettings, find_range
from tasks.work import Work


def run(work: Work) -> dict[str, Any]:
    """See `find_range`."""
    return run_correction(work, find_range, RangeSettings.model_validate(work.inputs["settings"]))
