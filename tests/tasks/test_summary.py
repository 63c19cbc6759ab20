"""What is stated of the whole correction, step by step."""

from typing import Any

import pytest

from tasks.summary import calibrated, last_uncertainty

Steps = dict[str, dict[str, Any]]


def step(changed: dict[str, Any], uncertainty: dict[str, Any]) -> dict[str, Any]:
    return {"changed": changed, "uncertainty": uncertainty, "evidence": {}}


POINT = step({"offset_px": [1.0, 2.0]}, {"offset_px": None})
SSIM = step({"range_factor": 1.01, "offset_px": [0.1, 0.1]}, {"range_factor": None})
LIMB = step({"range_factor": 1.01, "offset_px": [0.1, 0.1]}, {"range_factor": 1e-3, "offset_px": [0.05, 0.05]})
FLOW = step({"attitude_deg": [0.1, 0.2, 0.3]}, {"attitude_deg": [0.05, 0.05, 0.05]})
SURE_POINT = step({"offset_px": [1.0, 2.0]}, {"offset_px": [0.1, 0.1]})
JOINT = step(
    {"offset_px": [0.0, 0.0], "attitude_deg": [0.0, 0.1, 0.0], "range_factor": 1.0},
    {"offset_px": [0.02, 0.02], "attitude_deg": [0.2, 0.2, 0.2], "range_factor": None},
)


@pytest.mark.parametrize(
    ("steps", "is_stated"),
    [
        ({"point-1": POINT, "range-1": SSIM, "attitude-1": FLOW}, False),
        ({"point-1": POINT, "attitude-1": FLOW}, False),
        ({"point-1": SURE_POINT, "range-1": SSIM, "attitude-1": FLOW}, False),
        ({"point-1": SURE_POINT, "attitude-1": FLOW}, True),
        ({"point-1": POINT, "range-1": SSIM, "attitude-1": FLOW, "range-2": LIMB, "attitude-2": FLOW}, True),
        ({"start": step({}, {}), "point-1": POINT, "attitude-1": FLOW, "joint-1": JOINT}, True),
    ],
)
def test_an_attitude_by_flow_is_as_sure_as_stated_only_where_the_disks_place_is(steps: Steps, is_stated: bool) -> None:
    assert (last_uncertainty(calibrated(steps), "attitude_deg") is not None) == is_stated
    assert FLOW["uncertainty"]["attitude_deg"] is not None  # what a step itself says stays in the provenance
