"""What shows that the body in the picture is the target, and the errors that a pose file states of itself."""

import json
from pathlib import Path

import numpy as np
import pytest

from catalog.errors import RefusedError
from catalog.pose import POSE_KEYS, PartialPose, Pose, read_pose_file
from catalog.target import find_target
from tasks.accept.acceptance import doubtful_target
from tasks.accept.settings import AcceptSettings
from tasks.ingest.pose_step import PredictedPose
from tasks.priors import SourcePriors
from tasks.validate.limb import LimbFigures
from tasks.validate.step import OrientationReport, Similarity, ValidateResult
from tasks.validate.sun import SunReport

POSE = Pose(0.0, np.eye(3), np.array([0.0, 0.0, 1e6]), np.array([-4e8, 1e8, -5e8]), np.eye(3))
LIMB = LimbFigures(
    rms_px=0.1, mean_px=(0.0, 0.0), normal_rms_px=0.1, normal_median_px=0.0, robust_px=0.1, disagreeing=0.0, blur=1.0,
    psf_sigma_px=1.0, points=90, tried=90, similarity=0.95, correlation=0.95, likeness=0.95,
)  # fmt: skip


def report(verdict: str, patches: dict[str, float] | None = None, sigmas: float | None = None) -> ValidateResult:
    return ValidateResult(
        limb=LIMB,
        similarity=Similarity(before=None, after=None),
        sun=SunReport(),
        blocks=None,
        dark_limb={},
        orientation=OrientationReport(verdict=verdict, sigmas=sigmas),
        symmetry=None,
        doubt=None,
        patches=patches,
    )


def predicted(source: str, errors: dict[str, float]) -> PredictedPose:
    sources = dict.fromkeys(POSE_KEYS, source)
    return PredictedPose(
        pose=POSE, target=find_target("rhea"), source=source, sources=sources, evidence={}, errors=errors
    )


@pytest.mark.parametrize(
    ("verdict", "source", "errors", "doubted"),
    [
        ("no-map", "file", {}, True),
        ("undetermined", "file", {}, True),
        ("no-map", "image", {}, True),
        ("no-map", "file", {"roll_deg": 0.1, "attitude_deg": 1.0}, True),
        ("no-map", "file", {"range_share": 0.2}, True),
        ("no-map", "file", {"range_km": 2e5}, True),
        ("no-map", "file", {"range_km": 4e4, "range_share": 0.04}, True),
        ("no-map", "file", {"range_share": 0.01}, False),
        ("no-map", "file", {"range_km": 20.0}, False),
        ("matched", "file", {}, False),
        ("mismatched", "file", {}, False),  # that is a doubt of its own
        ("no-map", "spice", {}, False),
        ("no-map", "label", {}, False),
        ("undetermined", "isd", {}, False),
    ],
)
def test_neither_markings_nor_a_known_range_is_a_doubt(
    verdict: str, source: str, errors: dict[str, float], doubted: bool
) -> None:
    doubt = doubtful_target(AcceptSettings(), report(verdict), predicted(source, errors))
    assert (doubt is not None) == doubted
    if doubt:
        assert doubt.startswith("target-not-confirmed: ")
        assert "errors.range_km" in doubt


@pytest.mark.parametrize(("sigmas", "doubted"), [(-4.0, True), (0.5, True), (2.9, True), (3.1, False), (4.1, False)])
def test_markings_that_leave_the_orientation_open_may_show_the_body(sigmas: float, doubted: bool) -> None:
    found = report("undetermined", sigmas=sigmas)
    assert (doubtful_target(AcceptSettings(), found, predicted("file", {})) is not None) == doubted


def test_patches_of_a_close_up_show_which_body_it_is() -> None:
    patches = {"sigma_map_px": 0.1, "map_pixel_px": 2.0}
    assert doubtful_target(AcceptSettings(), report("undetermined", patches), predicted("file", {})) is None


@pytest.mark.parametrize(
    ("stated", "expected"),
    [
        ({}, (None, 0.02, 0.1, 30.0)),
        ({"range_share": 0.001}, (None, 0.001, 0.1, 30.0)),
        ({"range_km": 12.0}, (12.0, None, 0.1, 30.0)),
        ({"attitude_deg": 0.5}, (None, 0.02, 0.1, 0.5)),
        ({"roll_deg": 2.0, "range_km": 1.0, "range_share": 0.1}, (1.0, 0.1, 2.0, 30.0)),
    ],
)
def test_stated_errors_are_the_priors_in_place_of_assumed_ones(
    stated: dict[str, float], expected: tuple[float | None, ...]
) -> None:
    priors = SourcePriors().of(dict.fromkeys(POSE_KEYS, "file"), has_map=False, stated=stated)
    assert (priors.range_km, priors.range_share, priors.roll_deg, priors.attitude_deg) == expected


def test_a_pose_file_states_nothing_of_parts_that_are_others() -> None:
    sources = dict.fromkeys(POSE_KEYS, "spice") | {"camera_from_j2000": "file"}
    stated = {"range_km": 1.0, "roll_deg": 2.0, "attitude_deg": 0.01}
    priors, assumed = SourcePriors().of(sources, stated=stated), SourcePriors().of(sources)
    assert priors == assumed.model_copy(update={"roll_deg": 2.0})


def test_errors_of_a_pose_file_are_read_and_are_no_part_of_the_pose(tmp_path: Path) -> None:
    path = tmp_path / "pose.json"
    path.write_text(json.dumps(POSE.to_dict() | {"errors": {"range_km": 20, "attitude_deg": 0.5}}))
    partial = read_pose_file(path)
    assert partial.errors == {"range_km": 20.0, "attitude_deg": 0.5}
    assert partial.completed().to_dict() == POSE.to_dict()
    assert PartialPose.from_dict(POSE.to_dict()).errors == {}


@pytest.mark.parametrize(
    ("errors", "fault"),
    [
        ({"range": 20}, "unknown errors"),
        ({"range_km": -1}, "must be finite and positive"),
        ({"range_km": 0}, "must be finite and positive"),
        ({"roll_deg": "0.1 deg"}, "roll_deg"),
        ({"attitude_deg": [1, 2, 3]}, "not a number"),
        ([20], "no JSON object"),
    ],
)
def test_errors_that_are_none_are_refused_with_the_file_and_the_fault(
    tmp_path: Path, errors: object, fault: str
) -> None:
    path = tmp_path / "pose.json"
    path.write_text(json.dumps(POSE.to_dict() | {"errors": errors}))
    with pytest.raises(RefusedError) as caught:
        read_pose_file(path)
    print(caught.value.reason)
    assert caught.value.code == "pose-file-invalid"
    assert "pose.json" in caught.value.reason
    assert fault in caught.value.reason
