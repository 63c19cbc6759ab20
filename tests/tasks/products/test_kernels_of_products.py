"""From published products to kernel sets, as the command does it."""

import json

import numpy as np
import pytest
from small_product import pose_of, small_publication
from typer.testing import CliRunner

from catalog.errors import RefusedError
from catalog.spice import kernel_pool
from flows.cli import build_app
from tasks.kernels.exposure import read_exposure
from tasks.kernels.round_trip import largest_difference_deg, spice_planes
from tasks.kernels.store import kernels_of
from tasks.kernels.write import write_kernel_set
from tasks.project.backplanes import ANGLES
from tasks.publish import publish
from tasks.publish.cube import open_cube

BAR_DEG = 1e-4


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    folder = tmp_path_factory.mktemp("store")
    velocities = {"spacecraft_velocity_km_s": (4.0, -9.0, 2.0), "target_velocity_km_s": (-7.0, 1.0, 3.0)}
    for name, later_s in (("C0001", 0.0), ("C0002", 60.0)):
        pose = pose_of(20.0)
        pose = pose.replaced(et=pose.et + later_s, **velocities)
        provenance = {"image": {"sha256": "ab12", "exposure_s": 0.25}, "kernels": [{"name": "pck00010.tpc"}]}
        publish(small_publication(name, size=48, radius_px=20.0, pose_after=pose, provenance=provenance), folder)
    return folder


def test_a_product_becomes_an_exposure(store):
    exposure = read_exposure(store / "C0002")
    assert (exposure.product, exposure.exposure_s, exposure.moving) == ("C0002", 0.25, True)
    assert exposure.pose.et == pose_of(20.0).et + 60.0
    assert exposure.origin["image_sha256"] == "ab12"
    assert exposure.origin["kernels"] == ["pck00010.tpc"]


def test_the_command_writes_one_set_for_the_store_and_tells_the_round_trip(store, tmp_path):
    arguments = ["kernels", str(store), "--out", str(tmp_path / "out"), "--no-kernels", "--json"]
    done = CliRunner().invoke(build_app(), arguments)
    assert done.exit_code == 0, done.output
    out = tmp_path / "out" / "planetpose_test"
    assert sorted(p.name for p in out.iterdir()) == sorted(
        f"planetpose_test{suffix}" for suffix in (".tsc", ".tf", ".tpc", ".bpc", ".bc", "_alone.bsp", "_alone.tm")
    )


def test_a_damaged_product_is_left_out_and_reported(store, tmp_path):
    damaged = tmp_path / "C0003"
    (damaged / "cube.zarr").mkdir(parents=True)
    (damaged / "cube.zarr" / "zarr.json").write_text("{")
    arguments = ["kernels", str(store), str(damaged), "--out", str(tmp_path / "out"), "--no-kernels", "--no-check"]
    done = CliRunner().invoke(build_app(), arguments)
    assert done.exit_code == 1
    assert "C0003: left out: product-unreadable" in done.stderr
    assert (tmp_path / "out" / "planetpose_test" / "planetpose_test_alone.tm").is_file()


def test_what_is_reported_of_a_set(store, tmp_path):
    (reported,) = kernels_of([store], tmp_path, [])
    assert json.loads(json.dumps(reported)) == reported
    assert reported["products"] == ["C0001", "C0002"]
    assert max(reported["round_trip_deg"]["alone"].values()) < BAR_DEG
    assert {note["what"] for note in reported["left_out"]} == {"mission"}


def test_plain_spice_says_what_the_cube_says(store, tmp_path):
    exposure = read_exposure(store / "C0001")
    with kernel_pool([]) as loaded:
        kernel_set = write_kernel_set("one", [exposure], tmp_path, loaded)
    with open_cube(store / "C0001" / "cube.zarr") as cube:
        cube = cube.load()
    rows, columns = np.nonzero(np.isfinite(cube["latitude"].values))
    requested = {**kernel_set.names_of(exposure), "et": exposure.pose.et, "xy_px": np.stack([columns, rows], axis=-1)}
    (theirs,) = spice_planes([kernel_set.meta_kernels["alone"]], [requested], "LT+S")
    ours = {name: cube[name].values[rows, columns].astype(float) for name in ANGLES}
    found = largest_difference_deg(ours, theirs)
    print(f"{len(rows)} pixels of the cube's file, all of the disk: {found} deg, the bar is {BAR_DEG}")
    assert max(found.values()) < BAR_DEG


def test_no_product_or_one_twice_is_refused(store, tmp_path):
    with pytest.raises(RefusedError, match="given twice"):
        kernels_of([store, store / "C0001"], tmp_path, [])
    (tmp_path / "empty").mkdir()
    with pytest.raises(RefusedError, match="holds no product"):
        kernels_of([tmp_path / "empty"], tmp_path, [])
