"""The notebook runs from top to bottom, and carries no outputs."""

import json
import os
from pathlib import Path

import matplotlib.figure

NOTEBOOK = Path(__file__).parents[3] / "docs" / "notebooks" / "photometry.ipynb"


def test_the_notebook_runs_from_top_to_bottom(lunar_lambert_store, monkeypatch) -> None:
    monkeypatch.setenv("PLANETPOSE_STORE", os.fspath(lunar_lambert_store))
    world: dict[str, object] = {}
    cells = [cell for cell in json.loads(NOTEBOOK.read_text())["cells"] if cell["cell_type"] == "code"]
    for number, cell in enumerate(cells):
        exec(compile("".join(cell["source"]), f"cell {number}", "exec"), world)
    assert len(world["pixels"].products) == 4
    assert all(sigma > 0 for sigma in world["fit"].sigma.values())
    assert world["alone"]["L"].between(0.1, 0.9).all()
    assert isinstance(world["figure"], matplotlib.figure.Figure)
    assert len(world["regions"]) >= 2


def test_the_notebook_is_small_and_carries_no_outputs() -> None:
    content = json.loads(NOTEBOOK.read_text())
    assert content["nbformat"] == 4
    for cell in content["cells"]:
        if cell["cell_type"] == "code":
            assert (cell["outputs"], cell["execution_count"]) == ([], None)
    assert NOTEBOOK.stat().st_size < 20_000
