"""A distribution that adds a reader, a camera, a target, a registration and a law: built as a wheel and used."""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from small_image import PLANTED_OFFSET_PX

from catalog.camera import read_camera_file
from catalog.pose import Pose
from catalog.rotation import rotation_from_vector_deg
from catalog.target import read_target_file
from lab.simulate.independent import independent_image

SOURCE = Path(__file__).parent / "plugin"
PROFILE = {
    "base": "defaults",
    "passes": 1,
    "steps": ["point"],
    "simulate": {"oversample": 2, "photometry": "flat"},
    "point": {"registration": "centroid"},
}
CORRECT = """
import json, sys, planetpose
image, profile = json.loads(sys.argv[1])
result = planetpose.correct(image, "out", cache="cache", kernels=(), profile=profile)
print(json.dumps(result))
"""
Call = Callable[..., Any]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Built offline, from a copy, for a build leaves files beside the sources."""
    folder = tmp_path_factory.mktemp("wheel")
    shutil.copytree(SOURCE, folder / "source")
    pip("wheel", "--no-build-isolation", "--no-deps", "--wheel-dir", str(folder), str(folder / "source"))
    return next(folder.glob("*.whl"))


def pip(*arguments: str) -> None:
    command = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--no-input", *arguments, "--no-index"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.fixture
def installed(wheel: Path, tmp_path: Path) -> Path:
    """Folder on the path with the plugin and its entry points."""
    pip("install", "--no-deps", "--no-compile", "--target", str(tmp_path / "site"), str(wheel))
    return tmp_path / "site"


@pytest.fixture
def python(tmp_path: Path) -> Call:
    """Runs a program in a process of its own, with or without the plugin on the path: what it prints, and stderr."""

    def run(code: str, *arguments: str, site: Path | None = None) -> tuple[str, str]:
        environment = os.environ | {"PYTHONDONTWRITEBYTECODE": "1", "PYTHONPATH": str(site or "")}
        command = [sys.executable, "-c", code, *arguments]
        done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=300)
        assert done.returncode == 0, done.stderr
        return done.stdout, done.stderr

    return run


@pytest.fixture
def image(tmp_path: Path) -> Path:
    """An image in the mission's format, whose label has a pose that is wrong by some pixels."""
    camera = read_camera_file(SOURCE / "example_mission" / "cameras" / "example-nac.toml")
    target = read_target_file(SOURCE / "example_mission" / "targets" / "example-moon.toml")
    sun, turn = np.array([-1e8, 1e8, -7e8]), rotation_from_vector_deg([20, 30, 40])
    truth = Pose(0.0, np.eye(3), np.array([0.0, 0.0, 780_000.0]), sun, turn)
    clean = independent_image(camera, target, truth)
    noisy = 1000 + 500 * clean / clean.max() + np.random.default_rng(0).normal(0, 3, clean.shape)
    wrong = truth.replaced(camera_from_j2000=rotation_from_vector_deg([0.02, -0.015, 0]))
    label = {"lines": 104, "samples": 112, "target": "XMOON", "pose": wrong.to_dict()}
    path = tmp_path / "image.ex"
    path.write_bytes(b"EXAMPLE IMAGE 1\n" + json.dumps(label).encode() + b"\n" + noisy.astype("<f4").tobytes())
    return path


def edit(file: Path, old: str, new: str) -> None:
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new))


def test_an_image_goes_through_reader_camera_target_registration_and_law_of_a_plugin(
    installed: Path, image: Path, python: Call
) -> None:
    mission = installed / "example_mission"

    def correct() -> tuple[dict[str, Any], set[str]]:
        """The result, and the steps that were done."""
        out, _ = python(CORRECT, json.dumps([str(image), PROFILE]), site=installed)
        result = json.loads(out)
        assert result["status"] in ("ok", "doubtful"), result["reason"]
        return result, set(result["seconds"]) - set(result["cached"])

    every = {"ingest", "pose", "undistort", "point-1", "validate", "publish"}
    result, done = correct()
    assert (result["camera"], result["target"]) == ("example-nac", "example-moon")
    assert result["pose_source"] == "label"
    assert result["offset_px"] == pytest.approx(PLANTED_OFFSET_PX, abs=1.0)
    assert done == every

    edit(mission / "methods.py", '"""How far', '"""By how much')
    assert correct()[1] == set()  # a docstring
    edit(mission / "methods.py", "None, 1, 1.0", "None, 1, 0.9")
    assert correct()[1] == every - {"ingest", "pose", "undistort"}  # the registration and the law share a module
    edit(mission / "reader.py", 'format="example"', 'format="example-2"')
    assert correct()[1] >= {"ingest", "pose", "undistort"}
    edit(mission / "targets" / "example-moon.toml", "1560.0, 1560.0]", "1559.0, 1559.0]")
    assert correct()[1] >= {"pose", "point-1", "publish"}


def test_the_command_knows_what_a_plugin_adds(installed: Path, python: Call) -> None:
    code = "import sys; sys.argv = ['planetpose', {!r}, '--json']; from planetpose_launcher import main; main()"
    cameras, _ = python(code.format("cameras"), site=installed)
    targets, _ = python(code.format("targets"), site=installed)
    assert json.loads(cameras)["example-nac"]["focal_length_px"] == 20000.0
    assert json.loads(targets)["example-moon"]["naif_id"] == 9001
    names = "import planetpose; print(planetpose.find_target('xmoon').name, planetpose.find_target('europa').name)"
    assert python(names, site=installed)[0].split() == ["example-moon", "europa"]


REFUSED = """
import json, sys, planetpose
from tasks.profile import profile_of
found = []
for settings in json.loads(sys.argv[1]):
    try:
        profile_of(settings)
        found.append(None)
    except planetpose.RefusedError as error:
        found.append(error.reason)
print(json.dumps([found, list(planetpose.known_cameras())]))
"""
SETTINGS = [
    {"point": {"registration": "centroid"}},
    {"simulate": {"photometry": "flat"}},
    {"joint": {"mapped": ["lambert", "flat"]}},
    {"roll": {"photometry": "flat"}},
    {"point": {"registration": "centroyd"}},
    {"joint": {"plain": ["mixture"]}},
    {"point": {"registration": "ncc"}},
]


def refusals(python: Call, site: Path | None) -> tuple[list[str | None], list[str], str]:
    out, reported = python(REFUSED, json.dumps(SETTINGS), site=site)
    found, cameras = json.loads(out)
    return found, cameras, reported


def test_settings_take_the_names_of_plugins_and_refuse_unknown_ones(installed: Path, python: Call) -> None:
    found, _, reported = refusals(python, installed)
    assert (found[:4], found[6], reported) == ([None] * 4, None, "")
    assert "there is no registration 'centroyd'; known are ncc, " in str(found[4])
    assert "features, centroid" in str(found[4])
    assert "there is no photometric law 'mixture'" in str(found[5])
    without, cameras, _ = refusals(python, None)
    assert [reason is None for reason in without] == [False] * 6 + [True]
    assert "example-nac" not in cameras


@pytest.mark.parametrize("spoil", ["import a_package_that_is_missing\n", "def register(", "raise SystemError('no')\n"])
def test_a_broken_plugin_is_named_where_it_is_requested_and_hinders_nothing_else(
    spoil: str, installed: Path, python: Call
) -> None:
    (installed / "example_mission" / "methods.py").write_text(spoil)
    (installed / "example_mission" / "cameras" / "example-nac.toml").write_text("name = 3\n")
    found, cameras, reported = refusals(python, installed)
    for reason in found[:4]:
        assert str(reason).startswith("plugin-unusable: the plugin ")
        assert "of example-mission 1.0 (example_mission.methods:" in str(reason)
        assert "pip uninstall example-mission" in str(reason)
    assert found[6] is None
    assert "galileo-ssi" in cameras
    assert "example-nac" not in cameras
    assert "camera-file-invalid" in reported


def test_what_a_plugin_does_wrong_is_the_images_reason(installed: Path, image: Path, python: Call) -> None:
    edit(installed / "example_mission" / "methods.py", "None, 1, 1.0)", "None, 1, 1.0).offset_px")
    out, _ = python(CORRECT, json.dumps([str(image), PROFILE]), site=installed)
    result = json.loads(out)
    assert result["status"] == "refused"
    assert result["reason"].startswith("plugin-unusable: the plugin registration 'centroid' of example-mission 1.0")
    assert "gives ndarray instead of a Shift" in result["reason"]
