"""Decisions outlive products, are undone, and help corrections and later runs in the same way."""

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image
from small_product import EUROPA, camera_of, pose_of, small_publication

from catalog.camera import find_camera
from catalog.errors import RefusedError, WrongOptionError
from catalog.pose import read_pose_file
from flows.guided import guided, remember, remembered
from flows.options import ReprocessOptions
from flows.reprocessing.run import parameters_of
from flows.request import Request
from flows.requests import requests_of_list
from tasks.guidance.decisions import GUIDANCE, all_reviews, decide, decisions_of, help_in, review_of, undo
from tasks.guidance.helping import mask_option, on_detector, start_options
from tasks.publish import publish
from tasks.publish.cube_model import CubeModel

CAMERA = camera_of(160)


def test_decisions_are_kept_in_order_and_undone_one_by_one(tmp_path: Path) -> None:
    decide(tmp_path, "C1", "note", "a scratch", who="ada")
    decide(tmp_path, "C1", "accept", who="ada")
    decide(tmp_path, "C1", "reject", "on second thoughts", who="bob")
    found = decisions_of(tmp_path, "C1")
    assert [each.action for each in found] == ["note", "accept", "reject"]
    assert [each.who for each in found] == ["ada", "ada", "bob"]
    assert review_of(found) == ("rejected", "on second thoughts")
    taken = undo(tmp_path, "C1")
    assert taken is not None
    assert (taken.action, taken.undone is not None) == ("reject", True)
    assert all_reviews(tmp_path) == {"C1": ("accepted", "a scratch")}
    assert [undo(tmp_path, "C1") is None for _ in range(3)] == [False, False, True]
    assert len(decisions_of(tmp_path, "C1")) == 3
    content = json.loads((tmp_path / GUIDANCE / "C1.json").read_text())
    assert all(each["undone"] for each in content["decisions"])


def test_damaged_guidance_is_refused_by_name_and_leaves_other_images_alone(tmp_path: Path) -> None:
    decide(tmp_path, "C1", "accept")
    decide(tmp_path, "C2", "accept")
    (tmp_path / GUIDANCE / "C1.json").write_text('{"decisions": [{"action": "explode"}]}')
    with pytest.raises(RefusedError, match=r"C1\.json cannot be read"):
        decisions_of(tmp_path, "C1")
    assert all_reviews(tmp_path) == {"C2": ("accepted", "")}
    for name in ("../C1", "a/b", "", ".hidden"):
        with pytest.raises(RefusedError, match="no name of a product"):
            decide(tmp_path, name, "accept")
    with pytest.raises(ValueError, match="known are accept"):
        decide(tmp_path, "C2", "approve")


def test_files_of_a_help_are_those_of_the_store(tmp_path: Path) -> None:
    decide(tmp_path, "C1", "help", options={"mask": "../../secret.png"})
    with pytest.raises(RefusedError, match="is no file in"):
        help_in(tmp_path, "C1")


@settings(max_examples=25)
@given(centre=st.tuples(st.floats(-50, 200), st.floats(-50, 200)), factor=st.floats(0.5, 2), roll=st.floats(-170, 170))
def test_a_start_pose_is_where_the_disk_was_put(
    tmp_path_factory: pytest.TempPathFactory, centre: tuple[float, float], factor: float, roll: float
) -> None:
    store, predicted = tmp_path_factory.mktemp("store"), pose_of(60.0)
    model = CubeModel(predicted, CAMERA, EUROPA)
    offset = start_options(store, "C1", model, predicted, centre)
    here = CAMERA.project(predicted.target_in_camera_km)
    np.testing.assert_allclose(np.add(offset["start_offset_px"], here), centre, atol=1e-3)
    options = start_options(store, "C1", model, predicted, centre, factor, roll)
    if factor == 1 and roll == 0:
        return
    assert options == {"resume": "C1.pose.json"}
    pose = read_pose_file(store / GUIDANCE / "C1.pose.json").completed()
    np.testing.assert_allclose(CAMERA.project(pose.target_in_camera_km), centre, atol=1e-6)
    assert pose.range_km == pytest.approx(predicted.range_km * factor)


def test_what_is_no_pose_is_refused(tmp_path: Path) -> None:
    predicted = pose_of(60.0)
    model = CubeModel(predicted, CAMERA, EUROPA)
    for centre, factor in (((np.nan, 3.0), 1.0), ((80.0, 80.0), 0.0), ((80.0, 80.0), 99.0)):
        with pytest.raises(WrongOptionError):
            start_options(tmp_path, "C1", model, predicted, centre, factor)
    assert not (tmp_path / GUIDANCE).exists()


@pytest.mark.parametrize("name", ["galileo-ssi", "newhorizons-lorri", "voyager1-nac"])
def test_a_painted_mask_covers_the_same_place_on_the_detector(name: str) -> None:
    camera = find_camera(name)
    nx, ny = camera.size_px
    painted = np.zeros((ny, nx), dtype=bool)
    painted[ny // 4 : ny // 4 + 60, nx // 3 : nx // 3 + 80] = True
    raw = on_detector(camera, painted)
    assert raw.shape == camera.detector_size_px[::-1]
    scale = np.array(camera.detector_size_px) / camera.size_px
    ys, xs = np.nonzero(raw)
    middle = (np.array([nx // 3 + 39.5, ny // 4 + 29.5]) + 0.5) * scale - 0.5
    assert np.abs([xs.mean(), ys.mean()] - middle).max() < 12
    assert raw.sum() > painted.sum() * scale.prod() * 0.9


def test_a_mask_is_written_beside_the_guidance(tmp_path: Path) -> None:
    model = CubeModel(pose_of(60.0), CAMERA, EUROPA)
    painted = np.zeros((160, 160), dtype=bool)
    assert mask_option(tmp_path, "C1", model, painted) == {}
    painted[3:9, 20:40] = True
    assert mask_option(tmp_path, "C1", model, painted) == {"mask": "C1.mask.png"}
    np.testing.assert_array_equal(np.asarray(Image.open(tmp_path / GUIDANCE / "C1.mask.png")) > 0, painted)
    with pytest.raises(WrongOptionError, match="whole image"):
        mask_option(tmp_path, "C1", model, ~np.zeros_like(painted))
    with pytest.raises(WrongOptionError, match="the image 160x160"):
        mask_option(tmp_path, "C1", model, painted[:50])


def test_a_later_run_keeps_the_help_until_it_is_undone(tmp_path: Path) -> None:
    """`reprocess` makes the same request as the page does, so the steps have the same keys."""
    store = tmp_path / "out"
    store.mkdir()
    (tmp_path / "list.csv").write_text("product,image,camera,target\nC1,C1.png,voyager1-nac,europa\nC2,C2.png,,\n")
    options = ReprocessOptions(images=str(tmp_path / "list.csv"), store=str(store), kernels=())
    plain = requests_of_list(options)
    decide(store, "C1", "help", "the limb is on the other side", {"start_offset_px": [400.0, -3.5], "hold": ["roll"]})
    helped = requests_of_list(options)
    assert helped[0].start_offset_px == (400.0, -3.5)
    assert "roll" in helped[0].profile.hold
    assert helped[0] == guided(plain[0])
    assert helped[1] == plain[1]
    decide(store, "C1", "help", "better", {"resume": "C1.pose.json"})
    assert requests_of_list(options)[0].resume == store / GUIDANCE / "C1.pose.json"
    undo(store, "C1")
    assert requests_of_list(options)[0] == helped[0]
    undo(store, "C1")
    assert requests_of_list(options)[0] == plain[0]


def test_the_request_of_a_product_is_remembered_without_its_help(tmp_path: Path) -> None:
    store = tmp_path / "out"
    publish(small_publication("C1"), store)
    image = tmp_path / "C1.png"
    image.write_bytes(b"")
    request = Request(image=image, product="C1", store=store, camera="voyager1-nac", kernels=())
    assert remembered(store, "C1") is None
    remember(request)
    assert remembered(store, "C1") == request
    decide(store, "C1", "help", options={"start_offset_px": [1.0, 2.0]})
    remember(guided(request))
    assert remembered(store, "C1") == request
    assert remembered(store, "../C1") is None


def test_a_run_remembers_the_kernels_of_its_shell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """`status` in another shell, with other defaults, must not call everything out of date."""
    (tmp_path / "list.csv").write_text("product,image\nC1,C1.png\n")
    monkeypatch.setenv("PLANETPOSE_KERNELS", str(tmp_path / "kernels"))
    options = ReprocessOptions(images=str(tmp_path / "list.csv"), store=str(tmp_path))
    parameters = parameters_of(options)
    monkeypatch.setenv("PLANETPOSE_KERNELS", str(tmp_path / "others"))
    again = requests_of_list(ReprocessOptions(**parameters))[0]
    assert again.kernel_paths == [tmp_path / "kernels"]
    assert parameters_of(options.model_copy(update={"kernels": ()}))["kernels"] == []  # none is a choice, too
