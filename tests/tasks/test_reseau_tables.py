"""Reseau tables of the catalog: 202 marks each, 0-based, and clear refusals."""

from pathlib import Path

import numpy as np
import pytest

from catalog.errors import RefusedError
from catalog.reseau import COLUMNS, find_reseau_table, reseau_table_names


@pytest.mark.parametrize("name", ["vg1_na_sn7", "vg1_wa_sn6", "vg2_na_sn5", "vg2_wa_sn4"])
def test_a_table_holds_202_marks_of_a_regular_grid(name: str) -> None:
    table = find_reseau_table(name)
    assert len(table) == 202
    assert list(table.index) == list(range(1, 203))
    assert (np.abs(table.object_xy - 499.0) < 481).all()
    assert (np.abs(table.raw_xy - 399.5) < 415).all()


def test_lines_and_samples_become_zero_based_x_and_y() -> None:
    table = find_reseau_table("vg1_na_sn7")
    assert table.raw_xy[0] == pytest.approx([10.40, 2.60])
    assert table.object_xy[1] == pytest.approx([84.53, 19.41])


def test_unknown_names_and_broken_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(RefusedError, match="vg1_na_sn7"):
        find_reseau_table("vg3")
    broken = tmp_path / "mine.tsv"
    for text in ("a\tb\n1\t2\n", "\t".join(COLUMNS) + "\n1\t2\t3\n", "\t".join(COLUMNS) + "\n1\t2\t3\tx\t5\n"):
        broken.write_text(text)
        with pytest.raises(RefusedError, match="mine"):
            find_reseau_table(str(broken))
    assert reseau_table_names() == ["vg1_na_sn7", "vg1_wa_sn6", "vg2_na_sn5", "vg2_wa_sn4"]
