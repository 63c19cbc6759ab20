"""Frames of several bodies, from files to product: the reduced benchmark, and its ray caster's own truth."""

import numpy as np
import pytest

from lab.bodies.run import BAR_PX, run_scene, summary_of
from lab.bodies.scenes import KINDS, LEAST_LIT, lit_share, scene_of


@pytest.mark.parametrize("kind", ["beside", "half-hidden", "eclipsed"])
def test_bodies_that_the_pose_knows_disturb_no_correction(kind: str) -> None:
    row = run_scene(scene_of(kind, 1))
    assert row["status"] == "ok", row["reason"]
    assert row["centre_error_px"] <= BAR_PX
    assert row["body_wrong"] <= 1e-3
    assert row["shadow_wrong"] <= 1e-3
    if kind == "beside":
        assert row["roll_by"]["bodies"] == ["jupiter"]


@pytest.mark.parametrize("kind", KINDS)
def test_scenes_are_drawn_again_as_they_were(kind: str) -> None:
    first, again = scene_of(kind, 2), scene_of(kind, 2)
    assert first.pose() == again.pose()
    assert lit_share(first) >= LEAST_LIT
    assert first.others
    assert all(0 < np.linalg.norm(each.stated_km - each.from_target_km) < 50 for each in first.others)


def test_the_summary_counts_what_is_wrong() -> None:
    good = {
        "kind": "ring",
        "lit_px": 60.0,
        "status": "ok",
        "centre_error_px": 0.02,
        "sigmas": 1.0,
        "body_wrong": 0.0,
        "shadow_wrong": 0.002,
    }
    off = good | {"centre_error_px": 0.3, "sigmas": 8.0}
    honest = good | {"lit_px": 30.0, "centre_error_px": 0.2, "sigmas": 1.2}
    failed = {"kind": "shadow", "status": "failed", "centre_error_px": None}
    figures = summary_of([good, off, honest, failed])
    assert (figures["ok"], figures["wrong_ok"], figures["ok_beyond_bar"]) == (3, 1, 2)
    assert figures["shadow_right"] == pytest.approx(0.998)
    assert figures["large_beyond_bar"] == 1
    assert figures["by_kind"]["shadow"]["ok"] == 0
    assert figures["by_kind"]["ring"]["centre_worst_px"] == 0.3
