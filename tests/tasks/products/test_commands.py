"""The commands on stores, as they are typed: what they print, and their exit status."""

import json
import shutil

import pytest
import typer
from small_product import small_publication

from flows.cli import build_app
from tasks.publish import publish


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    store = tmp_path_factory.mktemp("store")
    publish(small_publication("C0001"), store)
    return store


@pytest.fixture
def run(capfd):
    def run(*words):
        try:
            status = build_app()([str(word) for word in words], standalone_mode=False)
        except SystemExit as end:
            status = end.code
        return status or 0, capfd.readouterr().out.splitlines()

    return run


def test_index_prints_a_table_or_json_lines(store, run):
    status, lines = run("index", store)
    assert status == 0
    assert "C0001" in lines[1]
    assert lines[-1] == f"1 products in {store / 'index.parquet'}"
    _, lines = run("index", store, "--json", "--rebuild")
    row = json.loads(lines[0])
    assert (row["product"], row["status"], row["target"]) == ("C0001", "ok", "europa")
    assert row["similarity_after"] is None
    assert row["utc"].endswith("Z")


def test_export_prints_the_files_and_says_what_it_cannot_do(store, run, tmp_path):
    status, lines = run("export", store, "-f", "cog", "-f", "csv", "--projection", "orthographic", "--out", tmp_path)
    assert status == 0
    assert lines == [f"{tmp_path}/C0001_orthographic_cog.tif", f"{tmp_path}/C0001.csv"]
    status, lines = run("export", store / "C0001", "-f", "csv", "--latitude", 89.99, 90, "--out", tmp_path, "--json")
    assert status == 1
    assert json.loads(lines[0])["reason"].startswith("no-pixels: ")
    with pytest.raises(typer.BadParameter, match="no projection mercator"):
        run("export", store, "-f", "cog", "--projection", "mercator", "--out", tmp_path)


def test_status_of_what_correct_published_says_so_and_not_that_nothing_worked(store, run):
    status, lines = run("status", store)
    assert status == 0
    assert lines[0] == f"{store}: 1 product, published by `planetpose correct`"
    assert f"planetpose index {store}" in lines[1]
    assert json.loads(run("status", store, "--json")[1][0])["not_remembered"] == ["C0001"]


def test_check_prints_one_line_per_fault_and_its_status_tells_soundness(store, run):
    assert run("check", store) == (0, [f"{store}/C0001: sound", "1 of 1 products sound"])
    (store / "C0001" / "overlay.png").unlink()
    assert run("check", store / "C0001", "-q") == (
        1,
        [f"{store}/C0001: file: overlay.png is missing", "0 of 1 products sound"],
    )
    status, lines = run("check", store, "--json")
    assert status == 1
    assert json.loads(lines[0])["faults"] == [{"kind": "file", "fault": "overlay.png is missing"}]
    shutil.rmtree(store / "C0001" / "cube.zarr")
    assert run("check", store)[1][:-1] == [
        f"{store}/C0001: file: {name} is missing" for name in ("cube.zarr", "overlay.png")
    ]
