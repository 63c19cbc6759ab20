"""The cached step: attitude."""

from functools import partial
from typing import Any

from tasks.attitude import AttitudeSettings, find_attitude
from tasks.attitude.markings import UNKNOWN_DEG
from tasks.correcting import run_correction
from tasks.work import Work


def run(work: Work) -> dict[str, Any]:
    """See `find_attitude`."""
    prior_deg = work.inputs["attitude_prior_deg"] or UNKNOWN_DEG
    corrector = partial(find_attitude, prior_deg=prior_deg)
    return run_correction(work, corrector, AttitudeSettings.model_validate(work.inputs["settings"]))
