"""An image whose pointing is 400 px off is helped on the page and done again; later runs of `reprocess` agree."""

import json
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient
from small_image import TRUE_CENTRE_PX, write_small_archive

from catalog.pose import read_pose_file, write_pose_file
from catalog.rotation import rotation_from_vector_deg
from catalog.spice import KernelLists
from flows.one_image import one_result
from flows.options import ReprocessOptions
from flows.progress import Silent
from flows.requests import requests_of_list
from flows.trace import known_chain
from tasks.guidance.decisions import decisions_of
from tasks.publish.check import product_faults
from tasks.record import record_in
from tasks.registry import PUBLISH
from viewer.app import build_app
from viewer.security import Access

OFF_DEG = 400 / 20000 * 180 / np.pi  # 400 px of the small camera
LONGEST_S = 170


@pytest.fixture
def options(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ReprocessOptions:
    """An image list of one image, whose pose file points 400 px away."""
    write_small_archive(tmp_path)
    pose = read_pose_file(tmp_path / "pose.json").completed()
    turn = rotation_from_vector_deg([0.0, OFF_DEG, 0.0])
    write_pose_file(pose.replaced(camera_from_j2000=turn @ pose.camera_from_j2000), tmp_path / "pose.json")
    row = "small,small.png,small.toml,europa,pose.json"
    (tmp_path / "list.csv").write_text(f"product,image,camera,target,pose_file\n{row}\n")
    monkeypatch.setenv("PLANETPOSE_CACHE", str(tmp_path / "cache"))
    return ReprocessOptions(
        images=str(tmp_path / "list.csv"),
        store=str(tmp_path / "out"),
        profile=str(tmp_path / "quick.toml"),
        kernels=(),
        cache=tmp_path / "cache",
    )


def ended(client: TestClient, job: dict[str, Any]) -> dict[str, Any]:
    """The job when it is over."""
    deadline = time.monotonic() + LONGEST_S
    while job["status"] == "running" and time.monotonic() < deadline:
        time.sleep(0.2)
        job = client.get(f"/api/jobs/{job['number']}").json()
    return job


def test_help_redo_accept_and_a_later_run_agree(options: ReprocessOptions, tmp_path: Path) -> None:
    store = tmp_path / "out"
    first = one_result(requests_of_list(options)[0], Silent())
    assert first["guidance"]["start_offset_px"] is None
    assert first["status"] in ("ok", "doubtful"), first["reason"]
    access = Access(port=8080)
    client = TestClient(build_app(store, access), base_url="http://127.0.0.1:8080")
    token = {"x-planetpose-token": access.token}

    def post(path: str, content: dict[str, Any] | None = None) -> dict[str, Any]:
        answer = client.post(f"/api/products/small/{path}", json=content, headers=token)
        assert answer.status_code == 200, answer.text
        assert "fault" not in answer.json(), answer.text
        return dict(answer.json())

    centre = [TRUE_CENTRE_PX[0] + 1.5, TRUE_CENTRE_PX[1] - 1.0]
    given = {"centre_px": centre, "hold": ["roll"]}
    post("decisions", {"action": "help", "why": "the label is off", "help": given})
    job = ended(client, post("redo"))
    assert job["status"] in ("ok", "doubtful"), job
    assert "start" in job["done"]
    after = job["result"]
    np.testing.assert_allclose(after["centre_px"], TRUE_CENTRE_PX, atol=0.2)
    assert after["guidance"]["held"] == ["roll"]
    post("decisions", {"action": "accept"})

    # The product, its provenance and the next run of the list say the same.
    assert product_faults(store / "small") == []
    stated = json.loads((store / "small/result.json").read_text())
    assert stated["guidance"]["start_offset_px"] == decisions_of(store, "small")[0].options["start_offset_px"]
    chain, _ = known_chain(requests_of_list(options)[0], {}, KernelLists())
    last = chain.tried[-1].step
    assert (last.name, last.key) == (PUBLISH.name, record_in(store / "small").key)
    row = client.get("/api/table").json()["rows"][0]
    assert (row["review"], row["centre_x_px"]) == ("accepted", pytest.approx(after["centre_px"][0]))

    # Taken back, the image becomes what it was.
    post("undo")
    post("undo")
    again = ended(client, post("redo"))
    assert again["result"]["guidance"]["start_offset_px"] is None
    assert again["result"]["centre_px"] == first["centre_px"]


def test_an_image_that_is_gone_is_said(options: ReprocessOptions, tmp_path: Path) -> None:
    first = one_result(requests_of_list(options)[0], Silent())
    assert first["status"] in ("ok", "doubtful"), first["reason"]
    (tmp_path / "small.png").unlink()
    access = Access(port=8080)
    client = TestClient(build_app(tmp_path / "out", access), base_url="http://127.0.0.1:8080")
    token = {"x-planetpose-token": access.token}
    job = ended(client, client.post("/api/products/small/redo", headers=token).json())
    assert job["status"] == "refused"
    assert "is gone" in job["reason"]
    assert (tmp_path / "out" / "small" / "cube.zarr").is_dir()
