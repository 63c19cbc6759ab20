"""The command line as users and their scripts meet it, in processes of its own."""

import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from small_image import PLANTED_OFFSET_PX, TRUE_CENTRE_PX, write_small_archive

from catalog.pose import Pose
from catalog.unchanged import FOLDER as ANSWERS
from flows.cli import main
from flows.guided import REQUESTS
from flows.progress import Silent
from flows.request import Request
from flows.result import EMPTY
from flows.run import run_requests
from local_server.server import ServerFiles, stop_server

Cli = Callable[..., subprocess.CompletedProcess[str]]
PLANETPOSE = [sys.executable, "-c", "from flows.cli import main; main()"]
ROOT = Path(__file__).resolve().parents[2]
ARGUMENTS = [
    "small.png", "--camera", "small.toml", "--target", "europa", "--pose", "pose.json", "--profile", "quick.toml",
]  # fmt: skip
KEYS = [
    "product", "image", "status", "reason", "camera", "target", "utc", "pose_source", "profile", "warnings",
    "profile_origin", "guidance", "centre_px", "offset_px", "range_factor", "attitude_deg", "roll_deg",
    "roll_by", "range_factor_free", "psf_sigma_px", "uncertainty", "settled", "orientation", "stars", "bodies",
    "limb_rms_px", "limb_points", "limb_robust_px", "limb_disagreeing", "similarity", "patches", "pose", "cube",
    "overlay", "tried", "seconds", "cached",
]  # fmt: skip


def environment(state: Path, cache: Path, **more: str) -> dict[str, str]:
    """Environment of a command: its own state and cache, no kernels."""
    own = {"PLANETPOSE_STATE": str(state), "PLANETPOSE_CACHE": str(cache), "PLANETPOSE_KERNELS": ""}
    inherited = {name: value for name, value in os.environ.items() if not name.startswith("PREFECT_")}
    return inherited | own | {"PYTHONPATH": str(ROOT)} | more


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("archive")
    write_small_archive(folder)
    return folder


@pytest.fixture
def here(tmp_path: Path, archive: Path) -> Path:
    """A folder with the small image and its files."""
    shutil.copytree(archive, tmp_path / "here")
    return tmp_path / "here"


@pytest.fixture(scope="module")
def corrected(
    archive: Path, server_state: Path, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Path, subprocess.CompletedProcess[str]]:
    """A folder in which the small image was corrected, and the command's output."""
    folder = tmp_path_factory.mktemp("corrected") / "here"
    shutil.copytree(archive, folder)
    return folder, command(folder, server_state, "correct", *ARGUMENTS, "--json")


def command(folder: Path, state: Path, *arguments: str, **more: str) -> subprocess.CompletedProcess[str]:
    """Run planetpose in `folder`."""
    env = environment(state, folder / "cache", **more)
    return subprocess.run(
        [*PLANETPOSE, *arguments], cwd=folder, env=env, capture_output=True, text=True, timeout=240, check=False
    )


@pytest.fixture
def inside(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> Callable[..., subprocess.CompletedProcess[str]]:
    """`command` without a process of its own, for what ends before any work: a process takes seconds to start."""

    def run(folder: Path, *arguments: str, **more: str) -> subprocess.CompletedProcess[str]:
        with monkeypatch.context() as patch:
            patch.chdir(folder)
            for name in [name for name in os.environ if name.startswith("PREFECT_")]:
                patch.delenv(name)
            for name, value in environment(tmp_path / "state", folder / "cache", **more).items():
                patch.setenv(name, value)
            patch.setattr(sys, "argv", ["planetpose", *arguments])
            capfd.readouterr()
            status: Any = 0
            try:
                main()
            except SystemExit as end:
                status = end.code or 0
        return subprocess.CompletedProcess(list(arguments), int(status), *capfd.readouterr())

    return run


def test_correct_prints_one_json_object_and_nothing_else_on_stdout(
    corrected: tuple[Path, subprocess.CompletedProcess[str]],
) -> None:
    folder, done = corrected
    assert done.returncode == 0, done.stderr
    assert len(done.stdout.splitlines()) == 1
    result = json.loads(done.stdout)
    print(json.dumps({key: result[key] for key in ("centre_px", "offset_px", "range_factor", "limb_rms_px")}))
    assert list(result) == KEYS
    assert (result["product"], result["status"], result["reason"]) == ("small", "ok", None)
    assert (result["camera"], result["target"], result["pose_source"]) == ("small", "europa", "file")
    assert result["utc"].endswith("Z")
    assert result["centre_px"] == pytest.approx(TRUE_CENTRE_PX, abs=0.05)
    assert result["offset_px"] == pytest.approx(PLANTED_OFFSET_PX, abs=0.05)
    assert result["range_factor"] == pytest.approx(1, abs=5e-4)
    assert result["limb_rms_px"] < 0.2
    assert result["similarity"]["after"] > result["similarity"]["before"]
    assert set(result["uncertainty"]) == set(EMPTY["uncertainty"])
    assert result["guidance"] == EMPTY["guidance"]
    assert Pose.from_dict(result["pose"]).range_km == pytest.approx(780_000, rel=5e-4)
    assert result["cached"] == []
    assert list(result["seconds"]) == [
        "ingest", "pose", "undistort", "point-1", "range-1", "attitude-1", "validate", "publish"
    ]  # fmt: skip
    for part in (result["cube"], result["overlay"], "out/small/result.json", "out/small/settings.json"):
        assert (folder / part).exists()


def test_progress_goes_to_stderr_as_plain_lines_with_the_iterations(
    corrected: tuple[Path, subprocess.CompletedProcess[str]],
) -> None:
    lines = corrected[1].stderr.splitlines()
    assert any("small  point-1  iteration 1: moved" in line for line in lines)
    assert any("small  range-1  iteration" in line for line in lines)
    assert lines[-1].endswith("small  ok")
    assert "\x1b" not in corrected[1].stderr


def test_a_second_run_does_no_step_and_needs_no_prefect(
    corrected: tuple[Path, subprocess.CompletedProcess[str]], tmp_path: Path
) -> None:
    folder, first = corrected
    started = time.monotonic()
    second = command(folder, tmp_path / "no-state", "correct", *ARGUMENTS, "--json", PREFECT_API_URL="http://nowhere")
    seconds = time.monotonic() - started
    print(f"second run: {seconds:.2f} s (bar: 6 s)")
    result = json.loads(second.stdout)
    assert second.returncode == 0
    assert result["cached"] == list(result["seconds"])
    assert result | {"cached": []} == json.loads(first.stdout)
    assert not (tmp_path / "no-state").exists()


def test_a_command_that_had_nothing_to_do_says_its_kept_answer(
    corrected: tuple[Path, subprocess.CompletedProcess[str]], tmp_path: Path
) -> None:
    folder, _ = corrected
    launched = [sys.executable, "-P", str(ROOT / "planetpose_launcher.py"), "correct", *ARGUMENTS, "--json"]
    env = environment(tmp_path / "no-state", folder / "cache")
    second, third = (
        subprocess.run(launched, cwd=folder, env=env, capture_output=True, text=True, timeout=240, check=True)
        for _ in range(2)
    )
    assert third.stdout == second.stdout
    said, *progress = second.stderr.splitlines()
    assert progress[-1].endswith("small  ok")
    assert third.stderr == said + "\n"  # without lines of progress


def test_the_resolved_configuration_lies_beside_the_product(
    corrected: tuple[Path, subprocess.CompletedProcess[str]],
) -> None:
    folder, _ = corrected
    settings = json.loads((folder / "out/small/settings.json").read_text())
    assert settings["name"] == "quick"
    assert settings["passes"] == 1
    assert settings["simulate"]["oversample"] == 2
    assert settings["attitude"]["template_px"] == 13  # a default


def test_the_corrected_pose_is_a_pose_file(
    corrected: tuple[Path, subprocess.CompletedProcess[str]], server_state: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "here"
    shutil.copytree(corrected[0], folder)
    (folder / "pose.json").write_text(json.dumps(json.loads(corrected[1].stdout)["pose"]))
    again = command(folder, server_state, "correct", *ARGUMENTS, "--json", "--quiet")
    result = json.loads(again.stdout)
    assert result["status"] == "ok"
    assert result["offset_px"] == pytest.approx((0, 0), abs=0.05)
    assert result["cached"] == ["ingest", "undistort"]  # they do not depend on the pose
    assert again.stderr == ""


def test_changing_a_late_setting_redoes_only_what_follows(
    corrected: tuple[Path, subprocess.CompletedProcess[str]], server_state: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "here"
    shutil.copytree(corrected[0], folder)
    with (folder / "quick.toml").open("a") as profile:
        profile.write("[validate]\nhalf_px = 7\n")
    started = time.monotonic()
    result = json.loads(command(folder, server_state, "correct", *ARGUMENTS, "--json").stdout)
    print(f"changed setting of a late step: {time.monotonic() - started:.2f} s")
    assert result["status"] == "ok"
    assert result["cached"] == ["ingest", "pose", "undistort", "point-1", "range-1", "attitude-1"]


def test_show_draws_the_overlay_and_prints_its_path(
    corrected: tuple[Path, subprocess.CompletedProcess[str]], tmp_path: Path
) -> None:
    product = tmp_path / "small"
    shutil.copytree(corrected[0] / "out/small", product)
    (product / "overlay.png").unlink()
    shown = command(tmp_path, tmp_path / "state", "show", str(product))
    assert shown.returncode == 0, shown.stderr
    assert shown.stdout.strip() == str(product / "overlay.png")
    assert (product / "overlay.png").read_bytes().startswith(b"\x89PNG")
    refused = command(tmp_path, tmp_path / "state", "show", str(tmp_path / "nothing"))
    assert refused.returncode == 1
    assert "product-missing" in refused.stderr


def test_bad_images_are_refused_with_fault_and_remedy_and_leave_no_store(here: Path, server_state: Path) -> None:
    (here / "text.png").write_text("not an image")
    (here / "cut.png").write_bytes((here / "small.png").read_bytes()[:3000])
    done = command(here, server_state, "correct", "text.png", "cut.png", "none.png", *ARGUMENTS[1:], "--json")
    results = [json.loads(line) for line in done.stdout.splitlines()]
    assert done.returncode == 1
    assert [result["product"] for result in results] == ["text", "cut", "none"]
    assert [result["status"] for result in results] == ["refused"] * 3
    assert all(list(result) == KEYS for result in results)
    for result, fault, remedy in zip(
        results, ("text", "cut.png", "does not exist"), ("are read", "again", "Check the path"), strict=True
    ):
        assert fault in result["reason"]
        assert remedy in result["reason"]
        assert {key: result[key] for key in ("cube", "pose", "centre_px")} == dict.fromkeys(
            ("cube", "pose", "centre_px")
        )
    assert not (here / "out").exists()
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("changed", "fault"),
    [
        ({"camera": "nikon"}, "camera-unknown"),
        ({"camera": "quick.toml"}, "camera-file-invalid"),
        ({"target": "vulcan"}, "target-unknown"),
        ({"pose_file": "skewed.json"}, "not orthonormal"),
        ({"pose_file": "none.json"}, "pose-file-missing"),
        ({"pose_file": None}, "pose-unknown"),
        ({"basemap": "none.png"}, "base-map-missing"),
        ({"basemap": "small.png"}, "map-shape"),
        ({"kernels": ("none.bsp",)}, "kernel-missing"),
    ],
)
def test_bad_options_refuse_the_image_and_say_why(
    here: Path, prefect_api: str, monkeypatch: pytest.MonkeyPatch, changed: dict[str, Any], fault: str
) -> None:
    monkeypatch.chdir(here)
    skewed = json.loads(Path("pose.json").read_text())
    skewed["camera_from_j2000"][0][0] += 0.01
    Path("skewed.json").write_text(json.dumps(skewed))
    given = {"camera": "small.toml", "target": "europa", "pose_file": "pose.json", "kernels": ()} | changed
    request = Request(image=Path("small.png"), cache=here / "cache", **given)
    result = run_requests([request], prefect_api, 1, Silent(), lambda _: None)[0]
    assert result["status"] == "refused"
    assert fault in result["reason"]
    assert not Path("out").exists()


def test_a_store_that_is_a_file_is_reported_before_any_work(here: Path, inside: Cli) -> None:
    (here / "taken").write_text("")
    for store, name in (("taken", "taken is a file"), ("taken/below", "taken on its way is a file")):
        done = inside(here, "correct", *ARGUMENTS, "--store", store, COLUMNS="400")
        assert (done.returncode, done.stdout) == (2, "")
        assert f"store {store}: " in done.stderr
        assert name in done.stderr
        assert "Give a folder" in done.stderr
        assert "Traceback" not in done.stderr


def test_what_cannot_be_written_is_reported_in_one_line(
    corrected: tuple[Path, subprocess.CompletedProcess[str]], tmp_path: Path
) -> None:
    (tmp_path / "taken").write_text("")
    arguments = ["export", str(corrected[0] / "out"), "--format", "csv", "--out", str(tmp_path / "taken/below")]
    done = command(tmp_path, tmp_path / "state", *arguments)
    assert (done.returncode, done.stdout.count("\n")) == (1, 1)
    assert done.stdout.startswith("small: file-trouble: ")
    assert str(tmp_path / "taken/below") in done.stdout
    assert "Traceback" not in done.stderr


def test_a_folder_in_place_of_an_image_is_refused_saying_what_to_give(here: Path, server_state: Path) -> None:
    (here / "raw").mkdir()
    done = command(here, server_state, "correct", "raw", "--store", "out", "-q")
    assert (done.returncode, done.stderr) == (1, "")
    reported = "image-is-folder: image raw is a folder. Give the files in it, for example raw/*.IMG."
    assert done.stdout == f"raw: refused: {reported}\n"


@pytest.mark.parametrize(
    "arguments",
    [
        ["correct"],
        ["correct", "a.png", "--no-such-option"],
        ["correct", "a.png", "--profile", "no-such-profile"],
        ["correct", "a.png", "--max-passes", "0"],
        ["correct", "a.png", "--map-left-edge-deg", "1000"],
        ["no-such-command"],
        ["cache", "clear", "--step", "no-such-step"],
    ],
)
def test_wrong_usage_ends_with_2_and_an_empty_stdout(tmp_path: Path, inside: Cli, arguments: list[str]) -> None:
    done = inside(tmp_path, *arguments)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr


@pytest.mark.parametrize(
    "arguments", [["correct", "a.png"], ["reprocess", "europa57", "--dry-run"], ["kernels", "out"]]
)
def test_a_folder_without_kernels_is_wrong_usage_of_every_command(
    tmp_path: Path, inside: Cli, arguments: list[str]
) -> None:
    (tmp_path / "empty").mkdir()
    done = inside(tmp_path, *arguments, "--kernels", "empty", COLUMNS="400")
    assert (done.returncode, done.stdout) == (2, "")
    assert "the folder empty holds no kernel" in done.stderr


@pytest.mark.parametrize("arguments", [["correct", "a.png"], ["reprocess", "europa57", "--dry-run"], ["demo"]])
def test_a_server_that_is_none_is_wrong_usage(tmp_path: Path, arguments: list[str]) -> None:
    for given, more in ((["--server", "nonsense"], {}), ([], {"PLANETPOSE_SERVER": "http:/nonsense"})):
        done = command(tmp_path, tmp_path / "state", *arguments, *given, COLUMNS="400", **more)
        assert (done.returncode, done.stdout) == (2, "")
        assert "nonsense' is neither local, embedded nor the URL of an API" in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_three_commands_at_once_without_a_server_start_one_and_all_succeed(here: Path) -> None:
    """The same image, cache and store: they also meet at every key and at the product."""
    state = here / "state"
    started = time.monotonic()
    try:
        processes = [
            subprocess.Popen(
                [*PLANETPOSE, "correct", *ARGUMENTS, "--json", "-q"],
                cwd=here,
                env=environment(state, here / "cache"),
                stdout=subprocess.PIPE,
                text=True,
            )
            for _ in range(3)
        ]
        results = [json.loads(process.communicate(timeout=240)[0]) for process in processes]
        servers = (state / "server" / "server.log").read_text().count("dashboard is disabled")
    finally:
        stop_server(ServerFiles(state / "server"))
    print(f"three commands at once, no server and no database before: {time.monotonic() - started:.1f} s")
    assert [process.returncode for process in processes] == [0] * 3
    assert [result["status"] for result in results] == ["ok"] * 3
    assert len({json.dumps(result["pose"]) for result in results}) == 1
    assert servers == 1
    left = {path.name for path in (here / "out").iterdir()}
    assert left == {"small", "index.parquet", ".index.lock", REQUESTS}  # no temporary is left


def test_lists_of_cameras_targets_and_profiles(tmp_path: Path, inside: Cli) -> None:
    for listing, name in (("cameras", "galileo-ssi"), ("targets", "europa"), ("profiles", "standard")):
        plain = inside(tmp_path, listing)
        content = json.loads(inside(tmp_path, listing, "--json").stdout)
        assert plain.returncode == 0
        assert name in plain.stdout
        assert name in content


def test_the_cache_can_be_measured_and_cleared(
    corrected: tuple[Path, subprocess.CompletedProcess[str]], tmp_path: Path, inside: Cli
) -> None:
    folder = tmp_path / "here"
    shutil.copytree(corrected[0], folder)
    (folder / "cache" / "other").mkdir()
    (folder / "cache" / ANSWERS).mkdir(exist_ok=True)
    assert "point" in inside(folder, "cache", "size").stdout
    assert inside(folder, "cache", "clear", "--step", "range").returncode == 0
    assert not (folder / "cache" / "range").exists()
    assert (folder / "cache" / "point").exists()
    assert not (folder / "cache" / ANSWERS).exists()  # the command would not do the step again
    assert inside(folder, "cache", "clear").returncode == 0
    assert [path.name for path in (folder / "cache").iterdir()] == ["other"]  # nothing that is not ours


def test_the_result_has_the_keys_of_the_contract() -> None:
    assert list(EMPTY) == KEYS
