"""The public face: one list of names, documented, quick to import, and a user's own modules beside it."""

import ast
import inspect
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any, get_type_hints

import pytest
from small_image import PLANTED_OFFSET_PX, write_small_archive

import planetpose
from flows.image_options import ImageOptions
from flows.result import EMPTY
from planetpose import result as result_module
from tasks.publish.check import product_faults

ROOT = Path(__file__).resolve().parents[2]
NAMES = ("catalog", "tasks", "local_server", "flows", "viewer", "lab")
# What the stability promise covers. Adding a name is a minor version, taking one out a major one: see
# docs/reference/api/planetpose.md before changing this list.
PROMISED = [
    "Camera",
    "CubeAccessor",
    "CubeModel",
    "ExposureTime",
    "FailedError",
    "HiddenModuleWarning",
    "Law",
    "Match",
    "PartialPose",
    "PlanetposeError",
    "Pose",
    "Position",
    "Reader",
    "Reading",
    "RefusedError",
    "Registration",
    "Result",
    "Shift",
    "Target",
    "__version__",
    "backplanes",
    "correct",
    "find_camera",
    "find_target",
    "known_cameras",
    "known_targets",
    "model_of",
    "open_cube",
    "open_index",
    "open_store",
    "pixel_of",
    "place_of",
    "read_pose_file",
    "stars",
    "view",
    "widget",
    "write_pose_file",
]
PROMISED_OF_CORRECT = (
    "(image, store='out', *, product=None, camera=None, target=None, pose_file=None, kernels=None, basemap=None, "
    "map_left_edge_deg=0.0, shape=None, profile=None, hold=(), start_offset_px=None, mask=None, flip=None, "
    "plane=None, summing=None, window=None, resume=None, body=None, stars=None, cache=None, progress=None)"
)


# A process that talks to Prefect sets the latter: what it starts by `python -m` is not to look in the working folder.
OF_PYTHON = ("PYTHONPATH", "PYTHONSAFEPATH")


def run(code: str, folder: Path, *options: str, **more: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, *options, "-c", code]
    environment = {name: value for name, value in os.environ.items() if name not in OF_PYTHON} | more
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=300)


def test_the_promised_names_are_there_and_no_others() -> None:
    assert planetpose.__all__ == PROMISED
    assert dir(planetpose) == PROMISED
    for name in PROMISED:
        assert getattr(planetpose, name) is not None
    with pytest.raises(AttributeError, match=r"public are .*correct"):
        _ = planetpose.corect


def test_type_checkers_see_the_same_names_from_the_same_modules() -> None:
    tree = ast.parse((ROOT / "planetpose" / "__init__.py").read_text())
    block = next(node for node in tree.body if isinstance(node, ast.If))
    seen = {
        alias.asname: node.module for node in block.body if isinstance(node, ast.ImportFrom) for alias in node.names
    }
    assert seen == planetpose.PUBLIC
    assert (ROOT / "planetpose" / "py.typed").is_file()


def test_every_public_name_is_explained_and_typed() -> None:
    for name in sorted(planetpose.PUBLIC):
        found = getattr(planetpose, name)
        if not (inspect.isclass(found) or inspect.isfunction(found)) and not hasattr(found, "__wrapped__"):
            continue  # the type of a function
        assert (found.__doc__ or "").strip(), name
        if not inspect.isclass(found):
            hints = set(inspect.signature(found).parameters)
            annotated = set(getattr(found, "__wrapped__", found).__annotations__)
            assert hints | {"return"} == annotated, name


def test_the_arguments_of_correct_are_kept() -> None:
    signature = inspect.signature(planetpose.correct)
    bare = [p.replace(annotation=inspect.Parameter.empty) for p in signature.parameters.values()]
    assert str(signature.replace(parameters=bare, return_annotation=inspect.Signature.empty)) == PROMISED_OF_CORRECT


def test_whatever_the_command_takes_for_an_image_python_does_too() -> None:
    assert set(ImageOptions.model_fields) <= set(inspect.signature(planetpose.correct).parameters)


def test_the_typed_result_has_the_keys_of_results_and_of_their_documentation() -> None:
    assert list(get_type_hints(planetpose.Result)) == list(EMPTY)
    nested = {key: value for key, value in EMPTY.items() if isinstance(value, dict) and value}
    for key, value in nested.items():
        inner = getattr(result_module, key.capitalize())
        assert list(get_type_hints(inner)) == list(value), key
    page = (ROOT / "docs" / "reference" / "result.md").read_text()
    rows = [line.split("|")[1] for line in page.splitlines() if line.startswith("| `")]
    reported = [name for row in rows for name in row.replace("`", "").replace(",", " ").split()]
    assert sorted(reported) == sorted(EMPTY)


def test_importing_it_imports_nothing_that_is_slow(tmp_path: Path) -> None:
    slow = ("prefect", "mitsuba", "numpy", "pydantic", "xarray", "flows", "tasks", "catalog")
    code = f"import sys, planetpose; print([name for name in {slow!r} if name in sys.modules])"
    done = run(code, tmp_path)
    assert (done.returncode, done.stdout.strip()) == (0, "[]"), done.stderr


@pytest.fixture(params=["modules", "packages"])
def mine(tmp_path: Path, request: pytest.FixtureRequest) -> dict[str, Path]:
    """Files of the user's own of our names, in the working folder."""
    files = {}
    for name in NAMES:
        files[name] = tmp_path / (f"{name}.py" if request.param == "modules" else f"{name}/__init__.py")
        files[name].parent.mkdir(exist_ok=True)
        files[name].write_text("MINE = True\n")
    return files


USE = "import planetpose; planetpose.correct; print(planetpose.Pose.__module__, planetpose.Shift.__module__)"


def test_in_a_folder_with_files_of_our_names_it_works_and_names_them(mine: dict[str, Path], tmp_path: Path) -> None:
    done = run(USE, tmp_path)
    assert (done.returncode, done.stdout) == (0, "catalog.pose tasks.point.registration.base\n"), done.stderr
    for name, file in mine.items():
        assert f"{file} is hidden: `import {name}` gives planetpose's" in done.stderr
    assert "Rename the file" in done.stderr


def test_files_on_pythonpath_are_named_too(mine: dict[str, Path], tmp_path: Path) -> None:
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    done = run(USE, elsewhere, PYTHONPATH=str(tmp_path))
    assert done.returncode == 0, done.stderr
    assert f"{mine['flows']} is hidden" in done.stderr
    silent = run(USE, elsewhere, "-W", "error::UserWarning")
    assert (silent.returncode, silent.stderr) == (0, "")


def test_what_was_imported_before_stays_usable_and_is_named(mine: dict[str, Path], tmp_path: Path) -> None:
    code = f"import tasks, flows\n{USE}\nprint(tasks.MINE, flows.MINE); import tasks; print(tasks.__file__)"
    done = run(code, tmp_path)
    assert done.returncode == 0, done.stderr
    first, second, third = done.stdout.splitlines()
    assert (first, second) == ("catalog.pose tasks.point.registration.base", "True True")
    assert third == str(ROOT / "tasks" / "__init__.py")
    assert f"{mine['tasks']} was imported as 'tasks' before planetpose" in done.stderr
    assert f"{mine['catalog']} is hidden" in done.stderr
    assert done.stderr.count(str(mine["tasks"])) == 1


@pytest.mark.usefixtures("mine")
def test_warnings_can_be_turned_off_by_their_class(tmp_path: Path) -> None:
    code = f"import warnings; warnings.filterwarnings('ignore', '.*planetpose', UserWarning)\n{USE}"
    done = run(code, tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert issubclass(planetpose.HiddenModuleWarning, UserWarning)


def test_the_module_is_the_command(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "planetpose", "cameras", "--json"], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert "galileo-ssi" in json.loads(done.stdout)


CORRECT = """
import json, sys, planetpose
heard = []
def progress(step, iteration, text): heard.append(step)
given = dict(camera="small.toml", target="europa", pose_file="pose.json", profile="quick.toml", kernels=())
first = planetpose.correct("small.png", "out", cache="cache", progress=progress, **given)
again = planetpose.correct("small.png", "out", cache="cache", **given)
bad = planetpose.correct("none.png", "out", cache="cache", **given)
cube = planetpose.open_cube(first["cube"])
store = planetpose.open_store("out")
x, y = planetpose.pixel_of(cube, *planetpose.place_of(cube, 55.25, 50.5))
print(json.dumps([first, again, bad, heard, list(store), float(x), float(y), "prefect" in sys.modules]))
"""


def test_an_image_is_corrected_from_python_without_prefect(tmp_path: Path) -> None:
    write_small_archive(tmp_path)
    done = run(CORRECT, tmp_path)
    assert done.returncode == 0, done.stderr
    first, again, bad, heard, store, x, y, prefect = json.loads(done.stdout)
    assert first["status"] in ("ok", "doubtful"), first["reason"]
    assert first["offset_px"] == pytest.approx(PLANTED_OFFSET_PX, abs=0.3)
    assert again["cached"] == list(again["seconds"])
    assert (bad["status"], bad["reason"].partition(":")[0]) == ("refused", "image-missing")
    assert heard[0] == "ingest"
    assert heard[-1] == "publish"
    assert store == ["small"]
    assert product_faults(tmp_path / "out" / "small") == []
    assert (x, y) == pytest.approx((55.25, 50.5), abs=1e-6)
    assert not prefect


@pytest.mark.parametrize(
    ("given", "error", "reported"),
    [
        ({"profile": "pint"}, planetpose.RefusedError, "there is no profile 'pint'"),
        ({"product": "a/b"}, ValueError, "no name for a folder"),
        ({"flip": "upside-down"}, ValueError, "flip"),
        ({"summing": 0}, ValueError, "summing"),
        ({"window": (1, 2, 3)}, ValueError, "window"),
        ({"hold": ["of"]}, ValueError, "hold"),
        ({"profile": {"point": {"registration": "nncc"}}}, planetpose.RefusedError, "known are ncc, phase"),
    ],
)
def test_wrong_arguments_are_errors(
    given: dict[str, Any], error: type[Exception], reported: str, tmp_path: Path
) -> None:
    with pytest.raises(error, match=reported):
        planetpose.correct(tmp_path / "image.png", tmp_path, **given)
