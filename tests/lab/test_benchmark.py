"""The projection's speed and agreement with the real SPICE loop, at the bars that the project set itself."""

import json

import pytest
import spiceypy

from lab.benchmark import peers
from lab.benchmark.projection import EUROPA, benchmark_projection, frame_filling_scene, peer_figures
from tasks.project.backplanes import ANGLES
from tasks.project.planes import project_planes


@pytest.fixture(scope="module")
def figures():
    return benchmark_projection()


def test_the_projection_agrees_with_the_spice_loop_and_tells_how_much_faster_it_is(figures):
    """How fast is for the benchmark to say: on a busy machine the ratio of one run was 360 to 7000, its bar is 1000."""
    print(json.dumps(figures, indent=1))
    assert figures["size_px"] == [1024, 1024]
    assert len(figures["planes"]) == 5
    assert figures["on_body_fraction"] > 0.78
    assert figures["times_faster_than_spice"] == pytest.approx(figures["spice_loop_s"] / figures["ours_s"])
    assert figures["max_difference_deg"] <= 1e-6
    assert figures["spice_pixels_at_limb"] > 300
    assert figures["limb_difference_deg"] <= 1e-6


def test_the_benchmark_leaves_the_kernel_pool_as_it_was(figures):
    assert figures
    assert spiceypy.ktotal("ALL") == 0
    with pytest.raises(spiceypy.NotFoundError):
        spiceypy.bodn2c("PLANETPOSE_BODY")


def test_peers_are_compared_and_those_that_are_not_installed_are_null(monkeypatch):
    def nearly_ours(pose, camera, target):
        planes = dict(project_planes(pose, camera, target, planes=ANGLES).planes)
        return 2.0, planes | {"incidence": planes["incidence"] + 1e-5}

    def not_installed(pose, camera, target):
        raise ModuleNotFoundError("nobody")

    monkeypatch.setattr(peers, "PEERS", {"one": nearly_ours, "other": not_installed})
    pose, camera = frame_filling_scene(64)
    ours = project_planes(pose, camera, EUROPA, planes=ANGLES)
    figures = peer_figures(pose, camera, ours, 0.02)
    assert figures["other"] is None
    assert figures["one"]["times_slower"] == pytest.approx(100)
    assert figures["one"]["max_difference_deg"] == pytest.approx(1e-5)
    assert figures["one"]["off_limb_difference_deg"] == pytest.approx(1e-5)
    assert figures["one"]["pixels_seen_by_one_only"] == 0


def test_help_says_what_to_install_for_the_peers():
    from typer.testing import CliRunner

    from flows.cli import build_app

    help_text = CliRunner().invoke(build_app(), ["benchmark", "projection", "--help"]).output
    assert "planetpose[lab]" in help_text


def test_growth_is_measured_against_its_bars(tmp_path):
    """At a hundredth of its size; whether bars are kept is for `planetpose benchmark growth` to say."""
    from lab.benchmark import growth
    from lab.benchmark.index import small_publication
    from tasks.publish import publish

    first = growth.small_part(publish(small_publication(), tmp_path / "whole"), tmp_path / "one")
    batch = growth.batch(first, tmp_path / "batch", 100)
    assert list(batch["seconds"]) == [100]
    index = growth.index_of_many(first, tmp_path / "index", 300, 1000)
    assert (index["rows"], index["page"]) == (1000, 100)
    report = growth.report_of_many(tmp_path / "report", 5000)
    assert (report["files"], growth.kept(report)) == (3, True)
    assert not growth.kept({"mb": 2.0, "bar": {"mb": 1.0}})
    assert growth.exponent_of({100: 1.0, 1000: 100.0}) == pytest.approx(2.0)
