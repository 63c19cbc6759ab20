"""`planetpose sensitivity`: thresholds halved and doubled, one at a time."""

from pathlib import Path

import pytest
from pydantic import BaseModel
from typer.testing import CliRunner

from flows.cli import build_app
from lab.sensitivity.cases import cases_of
from lab.sensitivity.run import Row, changed, scaled, sensitivity, threshold_names, value_of
from lab.sensitivity.table import page
from tasks.joint import JointSettings
from tasks.joint.thresholds import Thresholds

SETTINGS = JointSettings()


def test_every_threshold_is_tried() -> None:
    names = threshold_names()
    parts = {name: type(part).model_fields for name, part in dict(Thresholds()).items() if isinstance(part, BaseModel)}
    assert {name for name in names if not name.startswith("tiles.")} == {
        f"{part}.{field}" for part, fields in parts.items() for field in fields
    }
    for name in names:
        halved, doubled = (changed(SETTINGS, name, factor) for factor in (0.5, 2.0))
        assert halved is not None or doubled is not None, name
        for other in (halved, doubled):
            if other is not None:
                assert value_of(other, name) != value_of(SETTINGS, name)
                assert [n for n in names if value_of(other, n) != value_of(SETTINGS, n)] == [name]


@pytest.mark.parametrize(("value", "factor", "expected"), [(1, 0.5, 1), (5, 0.5, 2), (4, 2.0, 8), (0.3, 2.0, 0.6)])
def test_whole_numbers_stay_whole_and_above_zero(value: float, factor: float, expected: float) -> None:
    assert scaled(value, factor) == expected
    assert type(scaled(value, factor)) is type(value)


def test_a_threshold_that_decides_moves_the_result_and_the_page_says_so() -> None:
    names = ("variance.block_px", "contradiction.bending")
    found = list(sensitivity(cases_of(["laws-032"]), SETTINGS, names=names))
    by_name = {(row.name, row.factor): row for row in found}
    assert found[0].name == "as they are"
    assert found[0].moved_sigmas == found[0].widened == 0
    assert by_name["variance.block_px", 2.0].moved_sigmas > 1e-3
    assert by_name["contradiction.bending", 0.5].moved_sigmas == 0  # no vidicon
    text = page([("Small disks", found, ["laws-032"])])
    assert "| `variance.block_px` | 8 | 2 |" in text
    assert "| `contradiction.bending`" not in text
    assert "`contradiction.bending`" in text


def test_a_page_without_any_row_that_decides_is_still_a_page() -> None:
    plain = Row("as they are", None, 1.0, 0.0, 0.0, 0.02, 1.0, 0, 0)
    assert "RMS 0.0200 px" in page([("Small disks", [plain], ["laws-032"])])


def test_an_unknown_scene_or_threshold_is_named(tmp_path: Path) -> None:
    for wrong in (["--scene", "laws-999"], ["--only", "iteration.nothing"]):
        done = CliRunner().invoke(build_app(), ["sensitivity", "--out", str(tmp_path / "page.md"), *wrong])
        assert done.exit_code != 0
        assert wrong[1] in f"{done.output}{done.exception}"
    assert not (tmp_path / "page.md").exists()
