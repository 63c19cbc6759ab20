"""The distortion report and its command."""

import json
from pathlib import Path

import numpy as np
import pytest

from catalog.observation import Observation
from catalog.reseau import find_reseau_table
from flows.cli import build_app
from lab.benchmark.undistortion import benchmark_undistortion
from lab.simulate.writers.fits import write_fits
from tasks.distortion.report import distortion_report
from tasks.undistort.mark_fit import spot

FIGURES = ("rmsd_px", "leave_one_out_px", "leave_one_out_median_px", "condition_number")


@pytest.fixture(scope="module")
def voyager_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A Voyager 1 NAC frame of plain sky with all its marks, shifted by (1.3, 2.1) px."""
    rng = np.random.default_rng(4)
    image = 30 + rng.normal(0, 0.7, (800, 800))
    rows, columns = np.mgrid[0:800, 0:800].astype(np.float64)
    for x, y in find_reseau_table("vg1_na_sn7").raw_xy + np.array([1.3, 2.1]):
        near = (slice(max(int(y) - 8, 0), int(y) + 9), slice(max(int(x) - 8, 0), int(x) + 9))
        image[near] *= 1 - 0.9 * spot(columns[near] - x, rows[near] - y)[0]
    observation = Observation(
        image.astype(np.float32), np.full((800, 800), 0.7, np.float32), np.zeros((800, 800), np.uint16)
    )
    path = tmp_path_factory.mktemp("voyager") / "sky.fits"
    write_fits(path, observation, "voyager1-nac", "io", 0.0, 1.0, as_bytes=False)
    return path


def test_the_command_prints_one_json_object_and_nothing_else(
    voyager_file: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    build_app()(["distortion", str(voyager_file), "--json", "--no-figures"], standalone_mode=False)
    report = json.loads(capfd.readouterr().out)
    assert report["camera"] == "voyager1-nac"
    assert report["marks_expected"] == 202
    assert report["marks_found"] + report["marks"]["outside"] > 195
    assert list(report["methods"]) == ["radial", "polynomial", "delaunay", "thin-plate", "beam-bending", "warped-table"]
    assert all(isinstance(figures[key], float) for figures in report["methods"].values() for key in FIGURES)
    assert report["chosen"] == "warped-table"
    assert report["figures"] == []


def test_it_prints_a_table_and_writes_the_figures(
    voyager_file: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    build_app()(["distortion", str(voyager_file), "--out", str(tmp_path / "figures")], standalone_mode=False)
    printed = capfd.readouterr().out
    assert "* warped-table" in printed
    figures = sorted((tmp_path / "figures").iterdir())
    assert sorted(line for line in printed.splitlines() if line.endswith(".png")) == [str(path) for path in figures]
    assert len(figures) == 4
    for path in figures:
        assert path.read_bytes().startswith(b"\x89PNG")


def test_a_camera_with_a_formula_lists_its_alternatives(tmp_path: Path) -> None:
    frame = np.zeros((800, 800), np.float32)
    path = tmp_path / "ssi.fits"
    write_fits(path, Observation(frame, frame + 1, frame.astype(np.uint16)), "galileo-ssi", "io", 0.0, 1.0, False)
    report = distortion_report(path, tmp_path)
    assert report["chosen"] == "ssi-cubic"
    assert set(report["methods"]) == {"none", "ssi-cubic", "ssi-quadratic", "radial-k1"}
    assert report["methods"]["ssi-cubic"]["corner_shift_px"] == pytest.approx(1.19, abs=0.01)
    assert all(figures["round_trip_px"] < 1e-6 for figures in report["methods"].values())
    assert len(report["figures"]) == 3
    assert report["marks_expected"] == 0


def test_the_benchmark_times_every_kernel_on_a_fitted_model() -> None:
    figures = benchmark_undistortion(repeats=25)
    print(f"{figures} (bar: bilinear below 0.1 s)")
    assert all(seconds > 0 for name, seconds in figures.items() if name.endswith("_s"))
