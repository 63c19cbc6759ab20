"""Source distribution and wheel: what is in them, and whether they work in an environment of their own."""

import ast
import fnmatch
import json
import re
import subprocess
import sys
import sysconfig
import tarfile
import tomllib
import venv
import zipfile
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, packages_distributions, requires
from pathlib import Path
from typing import Any

import pytest
import yaml  # type: ignore[import-untyped]

ROOT = Path(__file__).resolve().parents[2]
PROJECT: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
PACKAGES = ("catalog", "tasks", "local_server", "flows", "viewer", "lab", "planetpose")
NOT_IN_SDIST = (".ci/*", ".gitignore", ".pre-commit-config.yaml")


def tracked() -> list[str]:
    command = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    listed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    if listed.returncode:
        pytest.skip("needs the files under version control")
    return [name for name in listed.stdout.split("\0") if name and (ROOT / name).is_file()]


def run(*command: str | Path, cwd: Path) -> str:
    done = subprocess.run(list(map(str, command)), cwd=cwd, capture_output=True, text=True, timeout=500)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """The sdist, built from a copy of the files under version control, and the wheel, built from the sdist."""
    folder = tmp_path_factory.mktemp("package")
    for name in tracked():
        target = folder / "source" / name
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes((ROOT / name).read_bytes())
    backend = "import sys; from setuptools import build_meta; build_meta.build_sdist(sys.argv[1])"
    run(sys.executable, "-c", backend, folder, cwd=folder / "source")
    sdist = next(folder.glob("*.tar.gz"))
    wheel = ("-m", "pip", "wheel", "--no-build-isolation", "--no-deps", "--no-index", "-w", folder, sdist)
    run(sys.executable, *wheel, cwd=folder)
    return sdist, next(folder.glob("*.whl"))


def test_the_source_distribution_has_what_is_needed_to_test_document_and_deploy(built: tuple[Path, Path]) -> None:
    with tarfile.open(built[0]) as archive:
        inside = {name.partition("/")[2] for name in archive.getnames()}
    wanted = {name for name in tracked() if not any(fnmatch.fnmatch(name, pattern) for pattern in NOT_IN_SDIST)}
    assert wanted - inside == set()


def test_the_wheel_has_the_packages_with_their_data_and_nothing_else(built: tuple[Path, Path]) -> None:
    with zipfile.ZipFile(built[1]) as archive:
        inside = {name for name in archive.namelist() if ".dist-info/" not in name}
    wanted = {name for name in tracked() if name.partition("/")[0] in PACKAGES} | {"planetpose_launcher.py"}
    assert inside == wanted
    assert "planetpose/py.typed" in inside


SMOKE = """
import json, sys
import planetmapper, oops  # other tools of the field, beside it
import planetpose
given = dict(camera="small.toml", target="europa", pose_file="pose.json", profile="quick.toml", kernels=())
result = planetpose.correct("small.png", "out", cache="cache", **given)
cube = planetpose.open_cube(result["cube"])
print(json.dumps([result["status"], result["reason"], planetpose.__file__, planetpose.__version__, dict(cube.sizes)]))
"""


def test_the_wheel_works_in_an_environment_of_its_own(built: tuple[Path, Path], tmp_path: Path) -> None:
    """Beside planetmapper and rms-oops; dependencies are borrowed, the program itself is the wheel's alone."""
    from small_image import write_small_archive

    home = tmp_path / "environment"
    venv.create(home, symlinks=True)
    python = home / "bin" / "python"
    site = Path(run(python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))", cwd=tmp_path).strip())
    run(sys.executable, "-m", "pip", "--python", python, "install", "--no-deps", "--no-index", built[1], cwd=tmp_path)
    assert (site / "planetpose" / "py.typed").is_file()
    (site / "borrowed.pth").write_text(f"{sysconfig.get_path('purelib')}\n{sysconfig.get_path('platlib')}\n")
    assert run(home / "bin" / "planetpose", "--version", cwd=tmp_path) == f"planetpose {PROJECT['version']}\n"
    assert "galileo-ssi" in run(home / "bin" / "planetpose", "cameras", cwd=tmp_path)
    write_small_archive(tmp_path)
    profile = tmp_path / "quick.toml"  # the compiled loops of the other steps would be compiled anew for this place
    profile.write_text('steps = ["point"]\n' + profile.read_text())
    status, reason, file, version, sizes = json.loads(run(python, "-P", "-c", SMOKE, cwd=tmp_path).splitlines()[-1])
    assert status in ("ok", "doubtful"), reason
    assert (Path(file).parent, version) == (site / "planetpose", PROJECT["version"])
    assert sizes == {"y": 104, "x": 112}


def names_of(requirements: list[str]) -> set[str]:
    return {re.split(r"[<>=!~\[; ]", each)[0].lower().replace("_", "-") for each in requirements}


def brought_by(requirements: list[str]) -> set[str]:
    """Names of the distributions that these bring, with all that they require themselves."""
    found: set[str] = set()
    waiting = names_of(requirements)
    while waiting:
        name = waiting.pop()
        found.add(name)
        with suppress(PackageNotFoundError):  # of another platform
            needed = [each for each in requires(name) or () if "extra ==" not in each]
            waiting |= names_of(needed) - found
    return found


def test_every_import_of_the_program_is_brought_by_a_declared_dependency() -> None:
    """Or it would work only where something else happens to bring it. lab/ has an extra of its own."""
    providers = packages_distributions()
    extras = PROJECT["optional-dependencies"]
    allowed = brought_by(PROJECT["dependencies"] + extras["dask"] + extras["s3"] + extras["notebook"])
    of_lab = allowed | brought_by(extras["lab"])
    undeclared: dict[str, set[str]] = {}
    for package in PACKAGES:
        for path in (ROOT / package).rglob("*.py"):
            for top in tops_of(path) - set(sys.stdlib_module_names) - {*PACKAGES, "planetpose_launcher"}:
                provided = {name.lower().replace("_", "-") for name in providers.get(top, [top])}
                if not provided & (of_lab if package == "lab" else allowed):
                    undeclared.setdefault(top, set()).add(path.relative_to(ROOT).as_posix())
    assert undeclared == {}


def tops_of(path: Path) -> set[str]:
    """Top-level names that a file imports, also inside functions."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name.partition(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            found.add(node.module.partition(".")[0])
    return found


def test_the_conda_recipe_agrees_with_the_project() -> None:
    recipe = yaml.safe_load((ROOT / "deploy" / "conda" / "recipe.yaml").read_text())
    assert recipe["context"]["version"] == PROJECT["version"]
    assert recipe["about"]["summary"] in PROJECT["description"].replace(": corrected", ". corrected")
    own_names = {"opencv-python-headless": "py-opencv", "matplotlib": "matplotlib-base", "dask": "dask-core"}
    wanted = {"python": PROJECT["requires-python"]}
    for requirement in PROJECT["dependencies"]:
        name, limits = re.fullmatch(r"([\w.-]+)\s*(.*)", requirement).groups()  # type: ignore[union-attr]
        wanted[own_names.get(name, name)] = limits
    given = [requirement.partition(" ")[::2] for requirement in recipe["requirements"]["run"]]
    assert dict(given) == wanted
    assert len(given) == len(wanted)
    entries = [f"{name} = {value}" for name, value in PROJECT["scripts"].items()]
    assert recipe["build"]["python"]["entry_points"] == entries
    for step in recipe["tests"]:
        for command in step.get("script", []):
            assert command.split()[0] in ("planetpose", "pip", "python")


def test_the_citation_is_of_this_version_and_names_the_paper() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert (citation["cff-version"], citation["type"], citation["title"]) == ("1.2.0", "software", PROJECT["name"])
    assert (citation["version"], citation["license"]) == (PROJECT["version"], PROJECT["license"])
    assert all(author.get("name") or author.get("family-names") for author in citation["authors"])
    assert {author["family-names"] for author in citation["references"][0]["authors"]} >= {"Belgacem", "Schmidt"}
