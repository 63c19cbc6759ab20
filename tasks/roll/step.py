"""The cached step: roll."""

from typing import Any

from tasks.correcting import run_correction
from tasks.roll import RollSettings, find_roll
from tasks.work import Work


def run(work: Work) -> dict[str, Any]:
    """See `find_roll`."""
    return run_correction(work, find_roll, RollSettings.model_validate(work.inputs["settings"]))
