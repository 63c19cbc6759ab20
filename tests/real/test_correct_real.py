"""The whole chain on real images, against the bars that the project set itself. Figures are printed (pytest -s)."""

import json
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import spiceypy

from catalog.rotation import nearest_rotation
from flows.correct import one_result
from flows.plan import answer_from_cache
from flows.progress import Silent
from flows.request import Request
from tasks.step import run

pytestmark = pytest.mark.real

EUROPA, IO, PLUTO, ENCELADUS = "C0552809300R", "f1636832", "lor_0299140073_0x630_sci", "N1489034146_2"
CLOSE_UP = "C0532836239R"
FILES = {
    EUROPA: "galileo/C0552809300R.IMG",
    IO: "voyager/f1636832.raw",
    PLUTO: "new_horizons/lor_0299140073_0x630_sci.fit",
    ENCELADUS: "cassini/N1489034146_2.IMG",
    CLOSE_UP: "galileo/C0532836239R.IMG",
}
# Archived C-matrix of f1636832 (rows: sample axis, line axis, boresight, in B1950), from JPL's VICAR logs.
IO_CAMERA_FROM_B1950 = [
    [0.595661, 0.568173, 0.567773],
    [0.174710, 0.598289, -0.782002],
    [-0.784005, 0.565004, 0.257112],
]
FIGURES = (
    "status", "centre_px", "offset_px", "range_factor", "attitude_deg", "limb_rms_px", "limb_points", "similarity",
)  # fmt: skip


def write_io_pose(path: Path) -> Path:
    """Only the orientation; time and positions come from label and kernels."""
    matrix = nearest_rotation(np.array(IO_CAMERA_FROM_B1950)) @ spiceypy.pxform("J2000", "B1950", 0.0)
    path.write_text(json.dumps({"camera_from_j2000": nearest_rotation(matrix).tolist()}))
    return path


def write_rough_enceladus_pose(path: Path) -> Path:
    """What anybody can read off the picture: range from the disk's 586 px, Sun from the left by the terminator; the
    orientation is invented, and the target put into the frame's centre."""
    phase = np.radians(48.7)
    sun_km = 1.35e9 * np.array([-np.sin(phase), 0.08 * np.sin(phase), -np.cos(phase)])
    pose = {
        "camera_from_j2000": np.eye(3).tolist(),
        "target_from_spacecraft_km": [0.0, 0.0, 166953.3 * 252.1 / 293],
        "sun_from_target_km": sun_km.tolist(),
        "body_from_j2000": [[0, 0, -1], [1, 0, 0], [0, -1, 0]],
    }
    path.write_text(json.dumps(pose))
    return path


@pytest.fixture(scope="module")
def requests(data_folder: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Request]:
    folder = tmp_path_factory.mktemp("real")
    kernels, own = {"kernels": (data_folder / "kernels",)}, {"store": folder / "out", "cache": folder / "cache"}
    options: dict[str, dict[str, Any]] = {
        EUROPA: kernels,
        IO: kernels | {"target": "io", "pose_file": write_io_pose(folder / "io.json")},
        PLUTO: kernels,
        ENCELADUS: {"kernels": (), "pose_file": write_rough_enceladus_pose(folder / "enceladus.json")},
        CLOSE_UP: kernels,
    }
    return {name: Request(image=data_folder / "images" / FILES[name], **own, **options[name]) for name in FILES}


@pytest.fixture(scope="module")
def results(requests: dict[str, Request]) -> dict[str, dict[str, Any]]:
    with ThreadPoolExecutor(2) as pool:
        found = pool.map(lambda request: one_result(request, Silent(), run_step=run), requests.values())
        results = dict(zip(requests, found, strict=True))
    for name, result in results.items():
        seconds = sum(result["seconds"].values())
        print(f"{name} ({seconds:.0f} s):", json.dumps({key: result[key] for key in FIGURES}), result["reason"] or "")
    return results


@pytest.mark.parametrize("name", [EUROPA, IO, PLUTO, ENCELADUS])
def test_the_corrected_limb_is_the_images_limb(results: dict[str, dict[str, Any]], name: str) -> None:
    result = results[name]
    assert (result["status"], result["reason"]) == ("ok", None)
    assert result["limb_rms_px"] <= 1
    assert result["limb_points"] >= 200
    assert result["similarity"]["after"] > result["similarity"]["before"]
    assert Path(result["overlay"]).is_file()


def test_galileos_range_is_the_trajectorys_to_some_thousandths(results: dict[str, dict[str, Any]]) -> None:
    assert results[EUROPA]["pose_source"] == "label"
    assert results[EUROPA]["range_factor"] == pytest.approx(1, abs=0.003)


def test_the_voyager_disk_is_where_jpls_limb_fit_has_it(results: dict[str, dict[str, Any]]) -> None:
    x, y = results[IO]["centre_px"]
    assert results[IO]["pose_source"] == "file"
    assert 606.9 - 0.5 <= x <= 608.1 + 0.5
    assert 542.1 - 0.5 <= y <= 542.2 + 0.5


def test_a_close_up_without_limb_is_refused_and_leaves_nothing(
    results: dict[str, dict[str, Any]], requests: dict[str, Request]
) -> None:
    assert results[CLOSE_UP]["status"] == "refused"
    assert "no limb" in results[CLOSE_UP]["reason"]
    assert not requests[CLOSE_UP].product_folder.exists()


def test_an_image_without_geometry_or_kernels_names_both_remedies(requests: dict[str, Request], tmp_path: Path) -> None:
    changes = {"pose_file": None, "store": tmp_path / "out"}
    result = one_result(requests[ENCELADUS].model_copy(update=changes), Silent(), run_step=run)
    assert result["status"] == "refused"
    assert ".bsp (trajectory" in result["reason"]
    assert "--kernels" in result["reason"]
    assert "--pose" in result["reason"]
    assert not (tmp_path / "out").exists()


def test_a_second_time_every_answer_is_there(results: dict[str, dict[str, Any]], requests: dict[str, Request]) -> None:
    for name in (EUROPA, IO, PLUTO, ENCELADUS):
        again = answer_from_cache(requests[name])
        assert again is not None
        assert again["cached"] == list(again["seconds"])
        assert again | {"cached": []} == results[name]


def test_another_kernel_redoes_the_pose_and_nothing_after_it(
    results: dict[str, dict[str, Any]], requests: dict[str, Request], data_folder: Path, tmp_path: Path
) -> None:
    kernel = tmp_path / "more.tpc"
    kernel.write_text("KPL/PCK\n\\begindata\nBODY999999_RADII = ( 1 1 1 )\n\\begintext\n")
    request = requests[EUROPA].model_copy(update={"kernels": (data_folder / "kernels", kernel)})
    again = one_result(request, Silent(), run_step=run)
    assert again["status"] == "ok"
    assert set(again["seconds"]) - set(again["cached"]) == {"pose"}
    assert again["pose"] == results[EUROPA]["pose"]
