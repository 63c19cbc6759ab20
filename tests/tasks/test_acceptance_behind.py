"""A predicted pose that looks away from its target is the first sentence of the reason, whatever else is wrong."""

import numpy as np
import pytest

from catalog.errors import FailedError, PlanetposeError
from catalog.pose import Pose
from tasks.accept.acceptance import explained, refuse_doubtful_behind

AHEAD = Pose(0.0, np.eye(3), np.array([0.0, 0.0, 1e5]), np.array([1e8, 0.0, 0.0]), np.eye(3))
BEHIND = AHEAD.replaced(target_from_spacecraft_km=np.array([1e4, 0.0, -1e5]))
DOUBTS = [
    "limb-disagrees: markings put the limb 2.0 px off. Check the map.",
    "sun-direction-disagrees: shading puts the Sun +20 deg off. Check the Sun.",
    "psf-disagrees: the limb is sharper. Check.",
]


def sentences(error: PlanetposeError) -> list[str]:
    return str(error.fault).split(". ")


@pytest.mark.parametrize(("count", "end"), [(1, "off)."), (2, "and 1 more doubt)."), (3, "and 2 more doubts).")])
def test_the_first_sentence_is_the_cause_and_the_second_names_one_doubt(count: int, end: str) -> None:
    with pytest.raises(FailedError) as caught:
        refuse_doubtful_behind(BEHIND, DOUBTS[:count])
    first, second = sentences(caught.value)
    assert first == "the predicted pose has the target behind the camera, 174 deg from its boresight"
    assert second.endswith(end)
    assert second.count(";") == 0
    assert "limb-disagrees" in second
    assert "sun-direction" not in second


def test_a_failure_behind_the_camera_comes_after_the_cause() -> None:
    error = FailedError("range-out-of-bounds", "the range factor is 0.8.", "Check the range.")
    found = explained(error, BEHIND)
    assert found.code == "target-behind-camera"
    assert sentences(found)[0].startswith("the predicted pose has the target behind the camera")
    assert sentences(found)[1] == "With the camera turned towards it the correction fails: the range factor is 0.8."
    assert explained(error, AHEAD) is error


def test_what_looks_at_its_target_or_has_no_doubt_passes() -> None:
    refuse_doubtful_behind(AHEAD, DOUBTS)
    refuse_doubtful_behind(BEHIND, [])
