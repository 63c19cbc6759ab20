"""A slice of `planetpose benchmark fuzz`: damaged real files are refused or read, and end nothing."""

from pathlib import Path

import pytest

from lab.fuzz.bench import fuzz_readers, originals_in, table

pytestmark = pytest.mark.real
COUNT = 200
QUICK = ("C0552809300R.IMG", "f1636832.raw")  # labels beside images and .imq take long to parse


def test_two_hundred_damaged_files_crash_and_hang_nothing(data_folder: Path) -> None:
    quick = [o for o in originals_in(data_folder / "images") if o.path.name in QUICK]
    findings = fuzz_readers(quick, COUNT, seed=7)
    print("\n" + table(findings))
    assert findings.bad == []
    assert findings.total.total() == COUNT
    assert findings.total["refused"] > COUNT // 5
    assert findings.total["read"] > COUNT // 5
