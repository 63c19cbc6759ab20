"""The demo compares what was found with what was planted, and says so in a table."""

from pathlib import Path
from typing import Any

import pytest

from catalog.pose import read_pose_file
from flows.progress import Reporter, Silent
from flows.request import Request
from flows.result import EMPTY
from lab.demo.images import demo
from lab.demo.run import DemoRow, run_demo
from lab.demo.table import demo_table


def perfect(requests: list[Request], _: Reporter) -> list[dict[str, Any]]:
    """A corrector that knows the truth beside the image."""
    entries = {entry.product: entry for entry in demo().images}
    return [
        EMPTY
        | {
            "product": request.product,
            "status": "ok",
            "pose": read_pose_file(request.image.with_suffix(".truth.json")).completed().to_dict(),
            "offset_px": list(entries[request.product].offset_px),
            "range_factor": entries[request.product].range_factor,
            "attitude_deg": list(entries[request.product].attitude_deg),
            "limb_rms_px": 0.1,
        }
        for request in requests
    ]


def refusing(requests: list[Request], _: Reporter) -> list[dict[str, Any]]:
    """A corrector that gives up."""
    return [EMPTY | {"product": r.product, "status": "refused", "reason": "no-limb: because."} for r in requests]


def _rows(folder: Path, corrector: Any) -> list[DemoRow]:
    return run_demo(folder, corrector, Silent(), ("SIM_VG2_WAC",))


def test_a_perfect_correction_leaves_nothing(tmp_path: Path) -> None:
    (row,) = _rows(tmp_path, perfect)
    assert row.after is not None
    assert row.after.surface_px == 0
    assert row.before.surface_px == pytest.approx(80, abs=5)
    line = demo_table([row]).splitlines()[2]
    assert line.split()[:7] == ["SIM_VG2_WAC", "-57.40", "-57.40", "-57.40", "-57.40", "0.000", "0.000"]
    assert line.endswith("81.2 (340.5)")


def test_an_image_that_was_not_corrected_shows_its_reason(tmp_path: Path) -> None:
    (row,) = _rows(tmp_path, refusing)
    assert row.after is None
    assert "refused: no-limb: because." in demo_table([row])
    assert row.to_dict()["error_after"] is None


def test_the_demo_uses_the_planted_pose_and_no_kernels(tmp_path: Path) -> None:
    seen: list[Request] = []

    def watching(requests: list[Request], reported: Reporter) -> list[dict[str, Any]]:
        seen.extend(requests)
        return perfect(requests, reported)

    _rows(tmp_path, watching)
    assert seen[0].pose_file == tmp_path / "archive" / "SIM_VG2_WAC.predicted.json"
    assert seen[0].kernels == ()
    assert seen[0].store == tmp_path / "products"


def test_rows_are_plain_json_with_the_papers_figures(tmp_path: Path) -> None:
    import json

    (row,) = _rows(tmp_path, perfect)
    content = json.loads(json.dumps(row.to_dict(), allow_nan=False))
    assert content["paper"] == {"offset_px_mean_largest": [81.2, 340.5], "residual_px": 2.0}
    assert content["error_after"]["centre_px"] == [0, 0]
