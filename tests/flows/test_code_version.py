"""The version of a step's code follows what its modules compute, and nothing else."""

import ast
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from catalog.settings import PROJECT_ROOT
from flows.inputs import verdict_version
from tasks.code_version import PACKAGES, Sources
from tasks.registry import STEPS
from tasks.source_code import read_source

MODULES = {step.name: step.module for step in STEPS}


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A small project: room `a` uses catalog.shapes and, inside a function, room `b`; nobody uses catalog.unused."""
    files = {
        "catalog/__init__.py": "",
        "catalog/shapes.py": "RADIUS = 1\n",
        "catalog/deep.py": "X = 1\n",
        "catalog/unused.py": "X = 1\n",
        "tasks/__init__.py": "",
        "tasks/a/__init__.py": "from catalog.shapes import RADIUS\nfrom . import brick\n",
        "tasks/a/brick.py": "def f():\n    from tasks.b import (\n        g,\n        h,\n    )\n    return g, h, 1\n",
        "tasks/b/__init__.py": "from catalog import deep\n\ndef g():\n    return deep.X + 1\n",
        "tasks/c/__init__.py": "",
        "tasks/typed.py": "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from catalog.unused import X\n",
    }
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path


def version(project: Path, name: str) -> tuple[str, ...]:
    sources = Sources(project)
    return tuple(sources.of(module).digest for module in sorted(sources.reached_from(name)))


@pytest.mark.parametrize("changed", ["tasks/a/brick.py", "catalog/shapes.py", "tasks/b/__init__.py", "catalog/deep.py"])
def test_it_changes_with_every_file_that_the_step_reaches(project: Path, changed: str) -> None:
    before = version(project, "tasks.a")
    path = project / changed
    path.write_text(path.read_text().replace("1", "2"))
    assert version(project, "tasks.a") != before


@pytest.mark.parametrize("changed", ["catalog/unused.py", "tasks/c/__init__.py"])
def test_it_stays_when_files_change_that_the_step_does_not_reach(project: Path, changed: str) -> None:
    before = version(project, "tasks.a"), version(project, "tasks.typed")
    (project / changed).write_text("Y = 3\n")
    assert (version(project, "tasks.a"), version(project, "tasks.typed")) == before


SAME = {
    "a comment": ("X = 1\n", "# why\nX = 1  # one\n"),
    "a docstring": (
        'def f():\n    """One."""\n    return 1\n',
        'def f():\n    """Another\n    one."""\n    return 1\n',
    ),
    "its layout": ("def f(a, b):\n    return a\n", "def f(\n    a,\n    b,\n):\n    return (a)\n"),
    "a message": ('raise ValueError("it is bad")\n', 'raise ValueError("worse")\n'),
    "a fault": (
        'raise RefusedError("code", f"{x} is bad.", "Try.")\n',
        'raise RefusedError("code", f"bad: {x}", "")\n',
    ),
    "a log line": ('logger.warning("%s was lost", x)\n', 'logger.warning("lost: %s", x)\n'),
    "a message in a variable": (
        'def f(x):\n    fault = f"{x} is bad"\n    raise RefusedError("c", fault, "No.")\n',
        'def f(x):\n    fault = f"bad is {x}!"\n    raise RefusedError("c", fault, "Yes.")\n',
    ),
}
SAME |= {"a description": ('X = Field(1, description="one", ge=0)\n', 'X = Field(1, description="another", ge=0)\n')}
OTHER = {
    "a bound beside a description": ('X = Field(1, ge=0, description="a")\n', 'X = Field(1, ge=1, description="a")\n'),
    "a description that is computed": ("X = f(description=a)\n", "X = f(description=b)\n"),
    "a number": ("X = 1\n", "X = 2\n"),
    "an operator": ("def f(a):\n    return a + 1\n", "def f(a):\n    return a - 1\n"),
    "the code of an error": ('raise RefusedError("a", "x y", "")\n', 'raise RefusedError("b", "x y", "")\n'),
    "the kind of an error": ('raise RefusedError("a", "x y", "")\n', 'raise FailedError("a", "x y", "")\n'),
    "what a message shows": ('raise ValueError(f"{x} is bad")\n', 'raise ValueError(f"{y} is bad")\n'),
    "a text": ('def f():\n    return "one name"\n', 'def f():\n    return "another name"\n'),
    "a text that an error shows too": (
        'def f():\n    name = "a b"\n    check(name)\n    raise ValueError(name)\n',
        'def f():\n    name = "c d"\n    check(name)\n    raise ValueError(name)\n',
    ),
    "a default": ("def f(a=1):\n    return a\n", "def f(a=2):\n    return a\n"),
    "a decorator": ("@cache\ndef f():\n    return 1\n", "def f():\n    return 1\n"),
}


@pytest.mark.parametrize("case", SAME)
def test_what_changes_no_result_changes_no_digest(case: str) -> None:
    before, after = (read_source(text.encode(), "tasks").digest for text in SAME[case])
    assert before == after


@pytest.mark.parametrize("case", OTHER)
def test_what_may_change_a_result_changes_the_digest(case: str) -> None:
    before, after = (read_source(text.encode(), "tasks").digest for text in OTHER[case])
    assert before != after


def test_the_real_steps_reach_the_code_they_run() -> None:
    names = Sources(PROJECT_ROOT).reached_from("tasks.point.step")
    assert {"tasks.point.loop", "tasks.simulate.scene", "catalog.pose", "tasks.correcting", "tasks.step"} <= names
    assert not any(name.startswith(("flows.", "tasks.publish", "tasks.joint")) for name in names)


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of this program's sources."""
    root = tmp_path_factory.mktemp("copy")
    for package in PACKAGES:
        shutil.copytree(PROJECT_ROOT / package, root / package, ignore=shutil.ignore_patterns("*.pyc", "__pycache__"))
    return root


def test_editing_any_module_redoes_the_steps_that_import_it_and_no_others(copy: Path) -> None:
    """With a comment more nothing is another, with a line more exactly the edited modules are, and the steps whose
    modules import one of them. Who imports whom is compared with a second implementation, `grimp`. A module is edited
    in those rounds that its number has a binary digit 1 for: no two modules are edited in the same rounds."""
    import grimp

    graph = grimp.build_graph(*PACKAGES, cache_dir=None, exclude_type_checking_imports=True)
    modules = dict(every_module(copy))
    texts = {module: path.read_text() for module, path in modules.items()}
    fresh = Sources(copy)
    before = {module: fresh.of(module).digest for module in modules}
    for step, module in MODULES.items():
        reached = (graph.find_upstream_modules(module) | {module}) & modules.keys()
        assert fresh.reached_from(module) & modules.keys() == reached, step
    steps = {step: versions(fresh, fresh.reached_from(module)) for step, module in MODULES.items()}
    for digit in range(len(modules).bit_length()):
        edited = {module for number, module in enumerate(modules, start=1) if number >> digit & 1}
        for more, matters in (("\n# more\n", False), ("\n_MORE = 1\n", True)):
            for module in edited:
                modules[module].write_text(texts[module] + more)
            now = Sources(copy, fresh.known)
            other = {module for module in modules if now.of(module).digest != before[module]}
            assert other == (edited if matters else set())
            own = {step: now.reached_from(module) for step, module in MODULES.items()}
            redone = {step for step in MODULES if versions(now, own[step]) != steps[step]}
            assert redone == {step for step in MODULES if matters and own[step] & edited}
        for module in edited:
            modules[module].write_text(texts[module])


def versions(sources: Sources, modules: set[str]) -> list[str]:
    return [sources.of(module).digest for module in sorted(modules)]


def every_module(root: Path) -> Iterator[tuple[str, Path]]:
    for package in PACKAGES:
        for path in sorted((root / package).rglob("*.py")):
            parts = path.relative_to(root).with_suffix("").parts
            yield ".".join(parts[:-1] if parts[-1] == "__init__" else parts), path


def test_the_verdict_has_all_that_the_flow_of_an_image_imports_beside_the_steps() -> None:
    assert len(verdict_version()) == 16
    bodies = frozenset(step.module for step in STEPS) | {"tasks.registry"}
    reached = Sources(PROJECT_ROOT).reached_from("flows.image", bodies)
    needed = {"flows.inputs", "flows.chain", "flows.request", "tasks.profile", "flows.verdict"}
    assert needed <= reached
    assert not reached & bodies
    # what a step alone runs redoes that step, and a product only where it comes to another pose
    assert not reached & {"tasks.initial_pose.find", "tasks.joint.find_pose", "tasks.joint.gauss_newton"}


def test_every_body_says_in_its_types_what_it_needs_and_what_it_finds() -> None:
    for step in STEPS:
        tree = ast.parse((PROJECT_ROOT / Path(*step.module.split("."))).with_suffix(".py").read_text())
        bodies = [node for node in tree.body if isinstance(node, ast.FunctionDef) and node.name == step.body.__name__]
        assert len(bodies) == 1, step.name
        assert bodies[0].args.args[0].arg == "inputs", step.name
        assert bodies[0].returns is not None
        assert step.summary.endswith("."), step.name
