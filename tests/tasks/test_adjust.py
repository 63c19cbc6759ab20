"""What images share, on made-up joint results with planted truth."""

import numpy as np
import pytest
from numpy.typing import NDArray

from catalog.rotation import rotation_from_vector_deg
from catalog.target import find_target
from lab.simulate.small_world import small_camera, true_pose
from tasks.adjust import AdjustSettings, adjust
from tasks.adjust.factors import mean_factors, survives
from tasks.adjust.likelihood import KINDS
from tasks.adjust.measurement import LIGHT_KM_S, Measurement, free_covariance
from tasks.adjust.report import adjusted, report_of
from tasks.adjust.solve import AT_ATTITUDE, sequences_of
from tasks.adjust.table import adjustment_table
from tasks.joint.parameters import ATTITUDE, NAMES, RANGE, ROLL, State, difference

Array = NDArray[np.float64]
EUROPA = find_target("europa")
MODEL = EUROPA.rotation
# As the joint step's: px, px, relative, three times degrees, relative.
SIGMA = np.array([0.03, 0.03, 4e-4, 0.15, 0.1, 0.12, 0.08, 0.05])
PRIOR = np.array([np.inf, np.inf, np.inf, 0.2, 1.0, 1.0, 1.0, 0.25])
SETTINGS = AdjustSettings()


def measured(
    rng: np.random.Generator,
    truth: Array,
    et: float,
    camera: str = "a",
    range_sigma: float = 2e-4,
    predicted_turn_deg: Array | None = None,
) -> Measurement:
    """A joint result for an image whose true step from the prediction (attitude: from the rotation model) is `truth`
    (8,): its errors are correlated, and priors about the prediction are part of it."""
    assert MODEL is not None
    cam = small_camera().model_copy(update={"name": camera})
    pose = true_pose(cam).replaced(et=et)
    body = MODEL.body_from_j2000(et - pose.range_km / LIGHT_KM_S)
    turn = np.zeros(3) if predicted_turn_deg is None else predicted_turn_deg
    pose = pose.replaced(body_from_j2000=rotation_from_vector_deg(turn).T @ body)
    mix = np.eye(len(NAMES)) + 0.3 * rng.standard_normal((len(NAMES),) * 2)
    correlation = mix @ mix.T
    unit = SIGMA / np.sqrt(np.diag(correlation))
    alone = correlation * np.outer(unit, unit)
    of_prediction = truth.copy()
    of_prediction[ATTITUDE] -= turn
    seen = of_prediction + np.linalg.cholesky(alone) @ rng.standard_normal(len(NAMES))
    information = np.linalg.inv(alone)
    with_prior = np.linalg.inv(information + np.diag(1 / PRIOR**2))
    step = with_prior @ information @ seen
    held = np.zeros(len(NAMES), bool)
    return Measurement(f"{camera}{et:.0f}", cam, EUROPA, pose, 0.8, step, with_prior, PRIOR, held, range_sigma)


def planted(
    rng: np.random.Generator, sequences: int, images: int, focal: float = 1.0, attitude_scatter_deg: float = 0.0
) -> tuple[list[Measurement], Array]:
    """Images of one camera and the true turn of each one's body (n, 3)."""
    found, turns = [], []
    roll, psf = 0.19, 0.1
    for number in range(sequences):
        turn, bias = rng.normal(0, 0.5, 3), rng.normal(0, 1e-4)
        for i in range(images):
            own = turn + rng.normal(0, attitude_scatter_deg, 3) if attitude_scatter_deg else turn
            truth = np.array([*rng.normal(0, 30, 2), bias - np.log(focal), roll, *own, psf])
            et = 1e5 * number + 60.0 * i
            found.append(measured(rng, truth, et, predicted_turn_deg=rng.normal(0, 0.3, 3)))
            turns.append(own)
    return found, np.array(turns)


def test_shared_attitudes_are_better_than_single_ones_by_the_root_of_their_number() -> None:
    images, turns = planted(np.random.default_rng(1), 6, 9, focal=1.001)
    found = adjust(images, SETTINGS)
    single = np.array([image.step[ATTITUDE] + image.turn_offset_deg for image in images]) - turns
    shared = found.shared[:, AT_ATTITUDE] - turns
    gain = np.sqrt(np.mean(single**2) / np.mean(shared**2))
    sigmas = np.sqrt(np.diagonal(found.shared_covariance, axis1=1, axis2=2))[:, AT_ATTITUDE]
    focal, roll, psf = found.theta[:3]
    errors = np.sqrt(np.diag(found.covariance)[:3])
    print(
        f"attitude: single {np.sqrt(np.mean(single**2)):.3f} deg, shared {np.sqrt(np.mean(shared**2)):.3f} deg, "
        f"{gain:.2f} times better (root of 9 images: 3); focal {np.exp(focal):.5f}, roll {roll:.3f}, scatter "
        f"{found.scatter}, chi-square {found.chi_square:.0f} of {found.degrees}"
    )
    assert len(found.sequences) == 6
    assert gain > 2.2
    assert 0.6 < np.sqrt(np.mean((shared / sigmas) ** 2)) < 1.5
    assert (np.abs([focal - np.log(1.001), roll - 0.19, psf - 0.1]) < 3.5 * errors).all()
    assert errors[1] < 0.04
    assert found.scatter[KINDS.index("attitude")] < 0.03
    assert abs(found.chi_square - found.degrees) < 4 * np.sqrt(2 * found.degrees)


def test_images_that_do_not_share_their_attitude_are_reported_so_and_keep_their_own() -> None:
    images, turns = planted(np.random.default_rng(2), 4, 5, attitude_scatter_deg=0.5)
    found = adjust(images, SETTINGS)
    report = report_of(images, found, adjusted(images, found), SETTINGS)
    consistency, ties = report["consistency"], {row["kind"]: row for row in report["ties"]}
    print(f"scatter {found.scatter}, {consistency}, {ties}")
    assert [kind for kind, row in ties.items() if not row["holds"]] == ["attitude"]
    assert ties["attitude"]["chi_square"] > 4 * ties["attitude"]["measurements"]
    for kind in ("range", "roll", "psf"):
        assert ties[kind]["chi_square"] < 2 * ties[kind]["measurements"]
    assert found.scatter[KINDS.index("attitude")] == pytest.approx(0.5, rel=0.3)
    assert consistency["probability"] < 1e-6
    assert np.sqrt(np.mean((found.shared[:, AT_ATTITUDE] - turns) ** 2)) < 0.15


def test_one_wrong_image_hardly_moves_its_sequence() -> None:
    images, _ = planted(np.random.default_rng(3), 2, 6)
    clean = adjust(images, SETTINGS)
    step = images[2].step + np.array([0, 0, 0.02, 0, 3.0, -3.0, 2.0, 0])
    bad = Measurement(**{**{name: getattr(images[2], name) for name in Measurement.__dataclass_fields__}, "step": step})
    found = adjust([*images[:2], bad, *images[3:]], SETTINGS)
    place = found.of_sequence(0)
    moved = (found.theta - clean.theta)[place] / np.sqrt(np.diag(clean.covariance)[place])
    print(f"weights {found.weights[:6].round(2)}, sequence moved {moved.round(2)} sigmas")
    assert found.weights[2] < 0.3
    assert np.median(found.weights) > 0.8
    assert np.abs(moved).max() < 2


def test_mean_free_factors_say_whether_distances_are_overestimated() -> None:
    rng = np.random.default_rng(4)
    still = np.array([0, 0, 0, 0.1, 0, 0, 0, 0.0])
    near = still + np.array([0, 0, -0.003, 0, 0, 0, 0, 0])
    images = [measured(rng, still, 60.0 * i, "a") for i in range(5)] + [
        measured(rng, near, 60.0 * i, "b") for i in range(5)
    ]
    a, b = mean_factors(images)
    print(survives([a, b]))
    assert a.mean == pytest.approx(1, abs=4 * a.sigma)
    assert b.mean == pytest.approx(np.exp(-0.003), abs=4 * b.sigma)
    assert a.sigma == pytest.approx(SIGMA[RANGE] / np.sqrt(5), rel=0.7)
    assert "survives when the blur is free for b only" in survives([a, b])
    assert "does not survive" in survives([a])


def test_sequences_are_of_one_camera_and_end_at_a_pause() -> None:
    rng, still = np.random.default_rng(5), np.zeros(len(NAMES))
    images = [measured(rng, still, et, camera) for et, camera in ((0, "a"), (700, "a"), (250, "a"), (260, "b"))]
    assert sequences_of(images, 300) == [[0, 2], [1], [3]]
    assert sequences_of(images, 500) == [[0, 2, 1], [3]]


def test_poses_follow_what_is_shared_and_the_table_names_everything() -> None:
    images, _ = planted(np.random.default_rng(6), 1, 3)
    found = adjust(images, SETTINGS)
    for image, pose, shared in zip(images, adjusted(images, found).poses, found.shared, strict=True):
        step = difference(State(pose, 0.8), State(image.predicted, 0.8), image.camera)
        assert step[ROLL] == pytest.approx(shared[1], abs=2e-3)
        assert step[ATTITUDE] == pytest.approx(shared[AT_ATTITUDE] - image.turn_offset_deg, abs=5e-3)
        assert step[:2] == pytest.approx(image.step[:2], abs=0.3)
        own = np.array([*image.step[2:4], *(image.step[ATTITUDE] + image.turn_offset_deg), image.step[7]])
        same = difference(image.state_with(own, image.step[RANGE]), State(image.predicted, 0.8), image.camera)
        assert same == pytest.approx(image.step, abs=1e-6)
    table = adjustment_table(report_of(images, found, adjusted(images, found), SETTINGS))
    for word in ("focal scale", images[0].product, "chi-square", "overestimated distance"):
        assert word in table


def test_the_free_covariance_is_what_it_was_before_the_range_was_weighed() -> None:
    rng = np.random.default_rng(7)
    free = measured(rng, np.zeros(len(NAMES)), 0.0).covariance
    prior = 2e-4
    gain = free[:, RANGE] / (free[RANGE, RANGE] + prior**2)
    after = free - np.outer(gain, free[RANGE])
    evidence = {"covariance": after.tolist(), "range_factor_prior_sigma": prior}
    again = free_covariance(evidence, float(np.sqrt(free[RANGE, RANGE])))
    assert np.abs((again - free) / np.outer(SIGMA, SIGMA)).max() < 1e-9
