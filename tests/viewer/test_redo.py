"""An image whose prior is 400 px off and that fails by it is helped in the browser and done again; later runs of
`reprocess` agree."""

import json
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient
from small_image import PROFILE, TRUE_CENTRE_PX, write_small_archive

from catalog.pose import read_pose_file, write_pose_file
from catalog.rotation import rotation_from_vector_deg
from catalog.spice import KernelLists
from flows.guided import remember
from flows.one_image import one_result
from flows.options import ReprocessOptions
from flows.progress import Silent
from flows.requests import requests_of_list
from flows.trace import known_chain
from lab.page.browser import browser_page, find_browser
from lab.page.drive import View, served
from tasks.diagnose.failed_folder import failed_folder, failed_result, note_result
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
    (tmp_path / "quick.toml").write_text(f"{PROFILE}[point]\ncoarse = false\n")  # believes the prior
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


@pytest.mark.skipif(find_browser() is None, reason="no Chromium or Chrome is installed")
def test_a_failed_image_is_helped_in_the_browser_and_a_later_run_agrees(
    options: ReprocessOptions, tmp_path: Path
) -> None:
    store = tmp_path / "out"
    first = one_result(requests_of_list(options)[0], Silent())
    assert first["status"] == "failed"
    with served(store) as url, browser_page(str(find_browser()), tmp_path / "browser") as page:
        view = View(page)
        view.open(url)
        assert view.text("#count") == "1 of 1 (1 failed)"
        assert view.text("#reason") == first["reason"]
        assert "To do:" in view.text("#advice")
        assert "as predicted" in view.text("#tried")
        # The frame's middle is where the disk is; then it is dragged and nudged as by somebody who sees it roughly.
        view.press("h")
        x, y = view.middle("#picture")
        view.click("#picture")
        view.drag((x, y), (x + 6, y - 6))
        view.press("ArrowRight")
        view.page.ask("document.querySelector('#help-panel input[value=roll]').click()")
        view.type("#help-why", "the label is off")
        view.click("#redo")
        view.wait("!document.getElementById('before-after').hidden || !document.getElementById('fault').hidden", 170)
        assert view.text("#fault") == ""
        view.press("Escape")
        view.press("a")
        view.wait("document.querySelector('#verdict').textContent.includes('accepted')")
        view.wait("document.querySelectorAll('#decisions li').length === 2")
        assert page.complaints == []

    # The product, its provenance and the next run of the list say the same; nothing is left of the failure.
    assert product_faults(store / "small") == []
    stated = json.loads((store / "small/result.json").read_text())
    assert stated["status"] in ("ok", "doubtful"), stated["reason"]
    np.testing.assert_allclose(stated["centre_px"], TRUE_CENTRE_PX, atol=0.2)
    helped, accepted = decisions_of(store, "small")
    assert (helped.why, accepted.action) == ("the label is off", "accept")
    assert np.abs(helped.options["start_offset_px"]).max() > 390
    assert stated["guidance"]["start_offset_px"] == helped.options["start_offset_px"]
    assert stated["guidance"]["held"] == ["roll"]
    chain, _ = known_chain(requests_of_list(options)[0], {}, KernelLists())
    last = chain.tried[-1].step
    assert (last.name, last.key) == (PUBLISH.name, record_in(store / "small").key)
    assert not failed_folder(store, "small").exists()

    # Taken back, the image fails as it did; its product stays, and the page says that it is older.
    access = Access(port=8080)
    client = TestClient(build_app(store, access), base_url="http://127.0.0.1:8080")
    token = {"x-planetpose-token": access.token}
    row = client.get("/api/table").json()["rows"][0]
    assert (row["review"], row["centre_x_px"]) == ("accepted", pytest.approx(stated["centre_px"][0]))
    for _ in range(2):
        client.post("/api/products/small/undo", headers=token)
    again = ended(client, client.post("/api/products/small/redo", headers=token).json())
    assert (again["status"], again["reason"]) == ("failed", first["reason"])
    shown = client.get("/api/products/small").json()
    assert (shown["failed_later"], shown["result"]["centre_px"]) == (first["reason"], stated["centre_px"])


def test_an_image_that_is_gone_is_said(options: ReprocessOptions, tmp_path: Path) -> None:
    folder = failed_folder(tmp_path / "out", "small")
    folder.mkdir(parents=True)
    note_result(folder, {"status": "failed", "reason": "target-not-found: nowhere."})
    remember(requests_of_list(options)[0])
    (tmp_path / "small.png").unlink()
    access = Access(port=8080)
    client = TestClient(build_app(tmp_path / "out", access), base_url="http://127.0.0.1:8080")
    token = {"x-planetpose-token": access.token}
    job = ended(client, client.post("/api/products/small/redo", headers=token).json())
    assert job["status"] == "refused"
    assert "is gone" in job["reason"]
    assert failed_result(tmp_path / "out", "small")["reason"] == "target-not-found: nowhere."
