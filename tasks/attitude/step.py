"""The cached step: attitude."""

from typing import Any

from tasks.attitude import AttitudeSettings, find_attitude
from tasks.correcting import run_correction
from tasks.work import Work


def run(work: Work) -> dict[str, Any]:
    """See `find_attitude`."""
    return run_correction(work, find_attitude, AttitudeSettings.model_validate(work.inputs["settings"]))
