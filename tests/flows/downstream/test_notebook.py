"""The notebooks run from top to bottom, and carry no outputs."""

import json
import os
from pathlib import Path
from typing import Any

import matplotlib.figure
import pytest

NOTEBOOKS = Path(__file__).parents[3] / "docs" / "notebooks"


def run_through(name: str) -> dict[str, Any]:
    world: dict[str, Any] = {}
    cells = [cell for cell in json.loads((NOTEBOOKS / name).read_text())["cells"] if cell["cell_type"] == "code"]
    for number, cell in enumerate(cells):
        exec(compile("".join(cell["source"]), f"cell {number}", "exec"), world)
    return world


def test_the_notebook_of_photometry_runs_from_top_to_bottom(lunar_lambert_store, monkeypatch) -> None:
    monkeypatch.setenv("PLANETPOSE_STORE", os.fspath(lunar_lambert_store))
    world = run_through("photometry.ipynb")
    assert len(world["pixels"].products) == 4
    assert all(sigma > 0 for sigma in world["fit"].sigma.values())
    assert world["alone"]["L"].between(0.1, 0.9).all()
    assert isinstance(world["figure"], matplotlib.figure.Figure)
    assert len(world["regions"]) >= 2


def test_the_notebook_of_maps_runs_from_top_to_bottom(lunar_lambert_store, monkeypatch) -> None:
    monkeypatch.setenv("PLANETPOSE_STORE", os.fspath(lunar_lambert_store))
    world = run_through("mosaic.ipynb")
    assert isinstance(world["figure"], matplotlib.figure.Figure)
    assert world["out"].with_suffix(".png").stat().st_size > 50_000
    assert world["table"]["reflectance"].notna().sum() >= 4
    assert world["table"]["residual %"].dropna().lt(10).all()


@pytest.mark.parametrize("path", sorted(NOTEBOOKS.glob("*.ipynb")), ids=lambda path: path.stem)
def test_a_notebook_is_small_and_carries_no_outputs(path: Path) -> None:
    content = json.loads(path.read_text())
    assert content["nbformat"] == 4
    for cell in content["cells"]:
        if cell["cell_type"] == "code":
            assert (cell["outputs"], cell["execution_count"]) == ([], None)
    assert path.stat().st_size < 20_000
