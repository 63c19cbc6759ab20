"""The rules of the house."""

import ast
import fnmatch
import graphlib
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import grimp
import pytest

ROOT = Path(__file__).resolve().parent.parent
FLOORS = ("catalog", "tasks", "local_server", "flows", "viewer", "planetpose", "lab")
SOURCES = [path for floor in FLOORS for path in sorted((ROOT / floor).rglob("*.py"))]
LARGEST_FILE = 1024 * 1024
LONGEST_MODULE = 300
KNOWS_PREFECT = {"tasks/prefect_task.py"}
KNOWS_ZARR = ("tasks/publish/", "tasks/stored.py")
# where one image's trouble must not stop the others
BOUNDARIES = {"tasks/boundary.py", "flows/correct.py", "flows/run.py"}
# where the code of another distribution must not stop ours
BOUNDARIES |= {"catalog/plugins.py"}


def name_of(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


@cache
def imports_of(path: Path) -> frozenset[str]:
    """Every module that a file imports, also inside functions."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found.add(node.module)
    return frozenset(found)


def packages_of(path: Path) -> set[str]:
    return {module.partition(".")[0] for module in imports_of(path)}


def tracked_files() -> list[Path]:
    """Files under version control; without git, everything that is no tool's cache."""
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=False)
    if listed.returncode == 0:
        return [ROOT / name for name in listed.stdout.split("\0") if name and (ROOT / name).is_file()]
    hidden = (".git", ".venv", "__pycache__", "egg-info", "_cache", ".hypothesis")
    return [path for path in ROOT.rglob("*") if path.is_file() and not any(part in str(path) for part in hidden)]


@pytest.mark.parametrize("floor", FLOORS)
def test_arrows_point_down_only(floor: str) -> None:
    above = set(FLOORS[FLOORS.index(floor) + 1 :]) | {"tests"}
    upward = {name_of(p): packages_of(p) & above for p in SOURCES if name_of(p).startswith(f"{floor}/")}
    assert {name: found for name, found in upward.items() if found} == {}


@pytest.fixture(scope="module")
def graph() -> grimp.ImportGraph:
    """Who imports whom, inside functions and for types as well."""
    return grimp.build_graph(*FLOORS, cache_dir=None)


def circle_in(imported_by: dict[str, set[str]]) -> list[str]:
    """One circle of importers, empty when there is none."""
    try:
        graphlib.TopologicalSorter(imported_by).prepare()
    except graphlib.CycleError as error:
        return list(error.args[1])
    return []


def test_no_module_is_imported_by_what_it_imports(graph: grimp.ImportGraph) -> None:
    # A module may name itself: what a Dask cluster is given by value finds its own module so.
    assert circle_in({name: graph.find_modules_directly_imported_by(name) - {name} for name in graph.modules}) == []


@pytest.mark.parametrize("floor", ["catalog", "tasks", "planetpose"])
def test_no_folder_is_imported_by_what_it_imports(graph: grimp.ImportGraph, floor: str) -> None:
    def folder(module: str) -> str:
        return ".".join(module.split(".")[:2])

    folders: dict[str, set[str]] = {}
    for name in graph.modules:
        if name.startswith(f"{floor}."):
            folders.setdefault(folder(name), set()).update(
                folder(other)
                for other in graph.find_modules_directly_imported_by(name)
                if folder(other) != folder(name)
            )
    assert circle_in(folders) == []


def test_a_circle_of_imports_would_be_found() -> None:
    assert set(circle_in({"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": {"a"}})) == {"a", "b", "c"}


# Tests of the estimator's own renderer, which draw with it.
DRAWS_WITH_THE_SCENE = {"tests/simulated/test_simulate_geometry.py", "tests/tasks/test_shine.py"}


def test_planted_truth_is_drawn_by_another_renderer_than_the_estimators(graph: grimp.ImportGraph) -> None:
    """What it is drawn by imports nothing of the estimator, and no test or benchmark draws with a scene."""
    drawn_by = graph.find_upstream_modules("lab.simulate.independent")
    assert "lab.honesty.caster" in drawn_by
    assert {name for name in drawn_by if name.partition(".")[0] not in ("catalog", "lab")} == set()
    files = [path for folder in ("tests", "lab") for path in sorted((ROOT / folder).rglob("*.py"))]
    scenes = ("tasks.simulate", "lab.simulate.small_world")
    with_scenes = [path for path in files if any(name.startswith(scenes) for name in imports_of(path))]
    assert len(with_scenes) > 10
    draws = {name_of(path) for path in with_scenes if re.search(r"\.render\(", path.read_text(encoding="utf-8"))}
    assert draws == DRAWS_WITH_THE_SCENE


def test_nothing_that_is_installed_for_users_names_a_module_of_the_instruments() -> None:
    """Nor as text, for modules are also started and looked up by name."""
    named = re.compile(r"""["'](lab\.\w+|lab/)""")
    product = [path for path in SOURCES if not name_of(path).startswith("lab/")]
    assert [name_of(path) for path in product if named.search(path.read_text())] == []


def test_prefect_is_known_only_where_tasks_and_flows_are_made() -> None:
    below = [p for p in SOURCES if not name_of(p).startswith(("local_server/", "flows/", "lab/"))]
    assert {name_of(path) for path in below if "prefect" in packages_of(path)} == KNOWS_PREFECT


def test_flows_hold_no_numerics() -> None:
    numeric = {"numpy", "scipy", "cv2", "skimage", "numba", "astropy", "mitsuba"}
    found = {name_of(path): packages_of(path) & numeric for path in SOURCES if name_of(path).startswith("flows/")}
    assert {name: packages for name, packages in found.items() if packages} == {}


def test_zarr_is_known_only_to_the_publisher_and_the_store_of_steps() -> None:
    known = {name_of(path) for path in SOURCES if "zarr" in packages_of(path) or ".to_zarr(" in path.read_text()}
    assert {name for name in known if not name.startswith(KNOWS_ZARR)} == set()


MAIN_ROAD = ("flows/image.py", "flows/inputs.py", "flows/chain.py", "tasks/step.py", "tasks/registry.py")


def test_the_main_road_is_typed_and_short() -> None:
    """No plain dictionaries in the signatures that lead an image to its cube; the flow reads like a figure."""
    road = [ROOT / name for name in MAIN_ROAD] + sorted((ROOT / "tasks").rglob("*step.py"))
    untyped = []
    for path in road:
        for node in ast.walk(ast.parse(path.read_text())):
            if not isinstance(node, ast.FunctionDef) or node.name.startswith("_"):
                continue
            annotations = [argument.annotation for argument in node.args.args] + [node.returns]
            written = [ast.unparse(annotation) for annotation in annotations if annotation]
            untyped += [f"{name_of(path)}: {node.name}: {text}" for text in written if "dict[str, Any]" in text]
    assert untyped == []
    assert len((ROOT / "flows/image.py").read_text().splitlines()) <= 130


def test_the_steps_are_listed_once() -> None:
    """Nowhere but in the registry do four or more names of steps stand in one list, tuple, set or table."""
    from tasks.registry import STEP_NAMES

    lists = []
    for path in SOURCES:
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Tuple | ast.List | ast.Set):
                names = {each.value for each in node.elts if isinstance(each, ast.Constant)}
            elif isinstance(node, ast.Dict):
                names = {each.value for each in node.keys if isinstance(each, ast.Constant)}
            else:
                continue
            if len(names & set(STEP_NAMES)) > 3:
                lists.append(f"{name_of(path)}:{node.lineno}")
    assert lists == []


def public_definitions(module: ast.Module) -> Iterator[ast.FunctionDef | ast.ClassDef]:
    """Public functions and classes of a module, and public methods of its classes."""
    for node in module.body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_"):
            yield node
            if isinstance(node, ast.ClassDef):
                methods = (child for child in node.body if isinstance(child, ast.FunctionDef))
                yield from (method for method in methods if not method.name.startswith("_"))


def test_modules_and_what_they_offer_are_explained() -> None:
    bare = []
    for path in SOURCES:
        module = ast.parse(path.read_text())
        explained = [(name_of(path), module), *((f"{name_of(path)}:{n.name}", n) for n in public_definitions(module))]
        bare += [name for name, node in explained if not ast.get_docstring(node)]
    assert bare == []


def test_modules_are_small() -> None:
    lengths = {name_of(path): len(path.read_text().splitlines()) for path in SOURCES}
    assert {name: length for name, length in lengths.items() if length > LONGEST_MODULE} == {}
    assert sorted(lengths.values())[len(lengths) // 2] <= 150


def test_contracts_are_no_asserts_and_failures_are_not_swallowed() -> None:
    faults = []
    for path in SOURCES:
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Assert):
                faults.append(f"{name_of(path)}:{node.lineno}: assert")
            broad = isinstance(node, ast.ExceptHandler) and (
                node.type is None
                or (isinstance(node.type, ast.Name) and node.type.id in ("Exception", "BaseException"))
            )
            if broad and name_of(path) not in BOUNDARIES:
                faults.append(f"{name_of(path)}:{node.lineno}: broad except")
    assert faults == []


def is_broad(handler: ast.ExceptHandler) -> bool:
    """Whether it catches everything."""
    return handler.type is None or (
        isinstance(handler.type, ast.Name) and handler.type.id in ("Exception", "BaseException")
    )


def test_no_file_knows_a_machine_or_a_package_registry() -> None:
    forbidden = re.compile(
        r"(?<![\w.~$}])/(work|tmp|root|home|Users)/|\b(pypi\.org|pythonhosted|conda\.anaconda)", re.I
    )
    faults = []
    for path in tracked_files():
        if path == Path(__file__).resolve():
            continue
        text = path.read_bytes().decode("utf-8", "ignore")
        faults += [f"{name_of(path)}: {found.group()}" for found in forbidden.finditer(text)]
    assert faults == []


def test_no_file_is_large() -> None:
    assert {name_of(p): p.stat().st_size for p in tracked_files() if p.stat().st_size > LARGEST_FILE} == {}


def test_every_data_file_is_installed_with_its_package() -> None:
    package_data = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]["package-data"]
    left_out = []
    for path in tracked_files():
        floor, _, inside = name_of(path).partition("/")
        if floor in FLOORS and path.suffix != ".py":
            patterns = package_data.get(floor, [])
            if not any(fnmatch.fnmatch(inside, pattern.replace("**/", "*")) for pattern in patterns):
                left_out.append(name_of(path))
    assert left_out == []


def test_constraints_pin_every_dependency_and_name_no_host() -> None:
    lines = [line for line in (ROOT / "constraints.txt").read_text().splitlines() if not line.startswith("#")]
    pins = {line.partition("==")[0].lower().replace("_", "-") for line in lines}
    assert all(re.fullmatch(r"[A-Za-z0-9._-]+==[A-Za-z0-9.+!]+", line) for line in lines)
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    wanted = project["dependencies"] + project["optional-dependencies"]["dev"] + project["optional-dependencies"]["lab"]
    names = {re.split(r"[<>=!~\[; ]", requirement)[0].lower() for requirement in wanted}
    assert names - pins == set()


def test_a_cached_answer_imports_nothing_that_is_slow() -> None:
    slow = (
        "prefect",
        "mitsuba",
        "zarr",
        "xarray",
        "dask",
        "astropy",
        "matplotlib",
        "spiceypy",
        "pyproj",
        "skimage",
        "cv2",
    )
    code = (
        "import sys, flows.cli, flows.run; flows.cli.build_app(); "
        f"print([name for name in {slow!r} if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


# Words that name nothing that the field knows.
VAGUE = re.compile(r"told|asked|believe|untold|workman|workforce|telling|settling|judge")
NAMED_BY_THE_FIELD = re.compile(r"masked")


def names_in(path: Path) -> set[str]:
    """Every identifier that a module makes or uses, its own name and those of the modules that it imports."""
    found = {path.stem}
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Name):
            found.add(node.id)
        elif isinstance(node, ast.Attribute):
            found.add(node.attr)
        elif isinstance(node, ast.FunctionDef | ast.ClassDef):
            found.add(node.name)
        elif isinstance(node, ast.arg) or (isinstance(node, ast.keyword) and node.arg):
            found.add(node.arg or "")
        elif isinstance(node, ast.alias):
            found.update(node.name.split("."))
    return found


def test_identifiers_are_the_fields_or_plain_words() -> None:
    named = [*SOURCES, *sorted((ROOT / "docs").rglob("*.py")), *sorted((ROOT / "tests").rglob("*.py"))]
    names = {path: names_in(path) for path in named}
    vague = {name for name in set().union(*names.values()) if VAGUE.search(NAMED_BY_THE_FIELD.sub("", name.lower()))}
    assert {name_of(path): found & vague for path, found in names.items() if found & vague} == {}
    assert any("backplanes" in found for found in names.values())
