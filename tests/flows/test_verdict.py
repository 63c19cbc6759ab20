"""The reason that a failed image is given."""

import errno
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from catalog.errors import FailedError, PlanetposeError, RefusedError
from catalog.pose import Pose
from catalog.rotation import rotation_from_vector_deg
from flows.verdict import reminded
from tasks.accept.acceptance import (
    check_limb,
    doubtful_limb,
    doubtful_psf,
    explained,
    is_about_orientation,
    refuse_doubtful_behind,
)
from tasks.accept.settings import AcceptSettings
from tasks.atomic import file_put_in_place, folder_put_in_place
from tasks.boundary import file_trouble
from tasks.validate.limb import LimbFigures, robust_rms
from tasks.validate.step import OrientationReport

POSE = Pose(0.0, np.eye(3), np.array([0.0, 0.0, 7.8e5]), np.array([-4e8, 1e8, -5e8]), np.eye(3))
LIMB = LimbFigures(
    rms_px=None, mean_px=None, normal_rms_px=None, normal_median_px=None, robust_px=None, disagreeing=None, blur=None,
    psf_sigma_px=None, points=3, tried=40, similarity=0.95, correlation=0.95, likeness=0.95,
)  # fmt: skip


def turned(degrees: float) -> Pose:
    """The camera turned away from the target."""
    return POSE.replaced(camera_from_j2000=rotation_from_vector_deg([degrees, 0, 0]))


@pytest.mark.parametrize("kind", [RefusedError, FailedError])
def test_a_failure_with_the_target_behind_the_camera_has_that_as_its_reason(kind: type[PlanetposeError]) -> None:
    error = explained(kind("target-not-found", "nothing looks like it.", "Check."), turned(170))
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
    assert explained(error, turned(degrees)) is error


@pytest.mark.parametrize("code", ["target-behind-camera", "interrupted"])
def test_what_says_more_than_the_side_of_the_camera_is_kept(code: str) -> None:
    error = FailedError(code, "so it is.", "Check.")
    assert explained(error, turned(170)) is error


def test_a_failure_after_the_label_was_overruled_says_so_before_other_advice() -> None:
    error = FailedError("range-out-of-bounds", "it is 1.06.", "Check range.")
    assert reminded(error, []) is error
    reported = reminded(error, ["the label says camera galileo-ssi, --camera voyager1-nac is used"])
    assert (type(reported), reported.code, reported.fault) == (FailedError, error.code, error.fault)
    assert (
        reported.remedy
        == "First of all: the label says camera galileo-ssi, --camera voyager1-nac is used. Check range."
    )


def test_a_limb_that_cannot_be_measured_is_distinguished_from_one_that_is_out_of_frame() -> None:
    for tried, words in ((40, "only 3 segments of the lit limb"), (0, "lit limb is nowhere on usable pixels")):
        with pytest.raises(FailedError, match=words) as failure:
            check_limb(AcceptSettings(), LIMB.model_copy(update={"tried": tried}))
        assert failure.value.code == "limb-not-measured"


def test_a_limb_elsewhere_than_the_corrected_pose_has_it_is_doubted_where_the_profile_says_from_when() -> None:
    accept = AcceptSettings(sure_limb_rms_px=0.5)
    assert doubtful_limb(accept, limb_of(np.full(100, 0.4))) is None
    assert doubtful_limb(accept, LIMB) is None
    assert str(doubtful_limb(accept, limb_of(np.full(100, 0.7)))).startswith("limb-disagrees: ")
    assert doubtful_limb(AcceptSettings(), limb_of(np.full(100, 0.7))) is None


def limb_of(shift_px: np.ndarray) -> LimbFigures:
    """What `validate` says of shifts across the limb."""
    rms_px, disagreeing = float(np.sqrt(np.mean(shift_px**2))), float(np.mean(np.abs(shift_px) > 1))
    measured = {"normal_rms_px": rms_px, "robust_px": robust_rms(shift_px), "disagreeing": disagreeing}
    return LIMB.model_copy(update=measured)


@pytest.mark.parametrize(
    ("share", "off_px", "doubted"),
    [
        (0.05, -5.5, False),
        (0.1, -6.0, False),
        (0.15, -4.0, False),
        (0.3, -3.0, True),
        (0.25, 1.5, True),
        (0.6, 0.9, True),
    ],
)
def test_segments_on_an_edge_of_albedo_raise_no_doubt_and_an_arc_that_is_off_does(
    share: float, off_px: float, doubted: bool
) -> None:
    shift_px = np.random.default_rng(0).normal(0.0, 0.15, 243)
    shift_px[: round(share * 243)] += off_px
    found = doubtful_limb(AcceptSettings(sure_limb_rms_px=0.5), limb_of(shift_px))
    print(limb_of(shift_px), found)
    assert (found is not None) == doubted


@pytest.mark.parametrize("predicted_deg", [95.0, 180.0])
def test_a_doubtful_pose_whose_predicted_one_looks_away_fails_with_that_as_its_reason(predicted_deg: float) -> None:
    refuse_doubtful_behind(turned(predicted_deg), [])
    refuse_doubtful_behind(turned(3.0), ["limb-disagrees: it does. Check."])
    with pytest.raises(
        FailedError, match=f"{predicted_deg:.0f} deg from its boresight.*limb-disagrees: it does"
    ) as failure:
        refuse_doubtful_behind(turned(predicted_deg), ["limb-disagrees: it does. Check."])
    assert failure.value.code == "target-behind-camera"


def test_a_store_that_cannot_be_written_is_reported_by_its_own_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def read_only(path: Path, *_: Any, **__: Any) -> None:
        raise OSError(errno.EROFS, "Read-only file system", str(path))

    (tmp_path / "store").mkdir()
    for put_in_place, writing in ((folder_put_in_place, "touch"), (file_put_in_place, "write_text")):
        monkeypatch.setattr(Path, writing, read_only)
        with pytest.raises(OSError, match=r"C1\.v2~.*\.tmp") as trouble, put_in_place(tmp_path / "store/C1.v2") as new:
            getattr(new, writing)("")
        reported = file_trouble(trouble.value)
        assert str(tmp_path / "store/C1.v2") in reported
        assert ".tmp" not in reported
        assert reported.endswith("Change its permissions, or name another place.")


@pytest.mark.parametrize(
    ("verdict", "is_reported"), [("matched", False), ("mismatched", False), ("undetermined", True), ("no-map", True)]
)
def test_what_the_flow_found_is_out_of_date_where_the_products_own_orientation_was_checked(
    verdict: str, is_reported: bool
) -> None:
    checked = OrientationReport(verdict=verdict, sigmas=9.0)
    assert is_about_orientation(checked) == (not is_reported)


@pytest.mark.parametrize(("solved_px", "shown_px"), [(3.3, 0.9), (2.1, 1.0), (1.5, 0.0), (9.0, 3.1)])
def test_a_solution_that_blurs_more_than_the_limb_is_blurred_is_doubted(solved_px: float, shown_px: float) -> None:
    doubt = doubtful_psf(AcceptSettings(), solved_px, LIMB.model_copy(update={"psf_sigma_px": shown_px}))
    assert doubt is not None
    assert doubt.startswith("psf-disagrees: ")


@pytest.mark.parametrize(
    ("solved_px", "shown_px"), [(0.5, 0.8), (0.9, 0.0), (3.8, 2.9), (6.0, 6.0), (None, 1.0), (5.0, None)]
)
def test_a_blur_that_the_limb_has_too_is_no_doubt(solved_px: float | None, shown_px: float | None) -> None:
    assert doubtful_psf(AcceptSettings(), solved_px, LIMB.model_copy(update={"psf_sigma_px": shown_px})) is None
