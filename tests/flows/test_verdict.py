"""The reason that a failed image is given."""

import errno
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from catalog.errors import FailedError, PlanetposeError, RefusedError
from catalog.pose import Pose
from catalog.rotation import rotation_from_vector_deg
from flows.profile import AcceptSettings
from flows.result import file_trouble
from flows.verdict import believe, doubtful_limb, explained, is_about_orientation, reminded
from tasks.atomic import file_put_in_place, folder_put_in_place

POSE = Pose(0.0, np.eye(3), np.array([0.0, 0.0, 7.8e5]), np.array([-4e8, 1e8, -5e8]), np.eye(3))
LIMB = {"rms_px": None, "points": 3, "tried": 40, "likeness": 0.95}


def turned(degrees: float) -> Pose:
    """The camera turned away from the target."""
    return POSE.replaced(camera_from_j2000=rotation_from_vector_deg([degrees, 0, 0]))


@pytest.mark.parametrize("kind", [RefusedError, FailedError])
def test_a_failure_with_the_target_behind_the_camera_has_that_as_its_reason(kind: type[PlanetposeError]) -> None:
    error = explained(kind("target-not-found", "nothing looks like it.", "Check."), turned(170).to_dict())
    print(error.reason)
    assert type(error) is kind
    assert error.code == "target-behind-camera"
    assert "170 deg from its boresight" in error.reason
    assert "nothing looks like it" in error.reason
    assert "camera_from_j2000" in error.reason
    assert "sign of target_from_spacecraft_km" in error.reason


@pytest.mark.parametrize("degrees", [0, 3, 89])
def test_a_failure_with_the_target_in_front_keeps_its_reason(degrees: float) -> None:
    error = FailedError("did-not-converge", "it did not.", "Check.")
    assert explained(error, turned(degrees).to_dict()) is error


@pytest.mark.parametrize("code", ["target-behind-camera", "interrupted"])
def test_what_says_more_than_the_side_of_the_camera_is_kept(code: str) -> None:
    error = FailedError(code, "so it is.", "Check.")
    assert explained(error, turned(170).to_dict()) is error


def test_a_failure_after_the_label_was_overruled_says_so_before_other_advice() -> None:
    error = FailedError("range-out-of-bounds", "it is 1.06.", "Check range.")
    assert reminded(error, []) is error
    told = reminded(error, ["the label says camera galileo-ssi, --camera voyager1-nac is used"])
    assert (type(told), told.code, told.fault) == (FailedError, error.code, error.fault)
    assert told.remedy == "First of all: the label says camera galileo-ssi, --camera voyager1-nac is used. Check range."


def test_a_limb_that_cannot_be_measured_is_told_from_one_that_is_out_of_frame() -> None:
    for tried, words in ((40, "only 3 segments of the lit limb"), (0, "lit limb is nowhere on usable pixels")):
        with pytest.raises(FailedError, match=words) as failure:
            believe(AcceptSettings(), {"limb": LIMB | {"tried": tried}})
        assert failure.value.code == "limb-not-measured"


def test_a_limb_elsewhere_than_the_corrected_pose_has_it_is_doubted_where_the_profile_says_from_when() -> None:
    accept = AcceptSettings(sure_limb_rms_px=0.5)
    assert doubtful_limb(accept, {"limb": {"rms_px": 0.4}}) is None
    assert doubtful_limb(accept, {"limb": {"rms_px": None}}) is None
    assert str(doubtful_limb(accept, {"limb": {"rms_px": 0.7}})).startswith("limb-disagrees: ")
    assert doubtful_limb(AcceptSettings(), {"limb": {"rms_px": 0.7}}) is None


def test_a_store_that_cannot_be_written_is_told_by_its_own_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def read_only(path: Path, *_: Any, **__: Any) -> None:
        raise OSError(errno.EROFS, "Read-only file system", str(path))

    (tmp_path / "store").mkdir()
    for put_in_place, writing in ((folder_put_in_place, "touch"), (file_put_in_place, "write_text")):
        monkeypatch.setattr(Path, writing, read_only)
        with pytest.raises(OSError, match=r"C1\.v2~.*\.tmp") as trouble, put_in_place(tmp_path / "store/C1.v2") as new:
            getattr(new, writing)("")
        told = file_trouble(trouble.value)
        assert str(tmp_path / "store/C1.v2") in told
        assert ".tmp" not in told
        assert told.endswith("Change its permissions, or name another place.")


@pytest.mark.parametrize(
    ("verdict", "is_told"), [("matched", False), ("mismatched", False), ("undetermined", True), ("no-map", True)]
)
def test_what_the_flow_found_is_out_of_date_where_the_products_own_orientation_was_judged(
    verdict: str, is_told: bool
) -> None:
    last = {"validate": {"orientation": {"verdict": verdict}}}
    assert is_about_orientation(last) == (not is_told)
    assert not is_about_orientation({})
