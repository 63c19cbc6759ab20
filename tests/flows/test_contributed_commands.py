"""Commands that come from outside flows: lab's own, and those of any installed distribution."""

import re
import sys
import tomllib
from pathlib import Path

import pytest
import typer
from typer.main import get_group
from typer.testing import CliRunner

from catalog.errors import RefusedError
from flows.cli import build_app
from flows.cli.contributed import GROUP

ROOT = Path(__file__).resolve().parents[2]
METADATA = "Metadata-Version: 2.1\nName: plugin\nVersion: 1.0\nProvides-Extra: withextra\n"
GOOD = """
import typer

def register(app: typer.Typer) -> None:
    app.command()(greet)

def greet(name: str) -> None:
    print(f"hello {name}")
"""


def installed(folder: Path, monkeypatch: pytest.MonkeyPatch, entries: dict[str, str], modules: dict[str, str]) -> None:
    """A distribution `plugin` with these entry points, name to module:attribute, and modules, on the path."""
    info = folder / "plugin-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(METADATA)
    lines = [f"[{GROUP}]", *(f"{name} = {value}" for name, value in entries.items())]
    (info / "entry_points.txt").write_text("\n".join(lines) + "\n")
    for name, text in modules.items():
        (folder / f"{name}.py").write_text(text)
        monkeypatch.delitem(sys.modules, name, raising=False)
    monkeypatch.syspath_prepend(folder)


def names(app: typer.Typer) -> set[str]:
    return set(get_group(app).commands)


def test_every_command_of_lab_is_installed() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    wanted = set(project["entry-points"][GROUP])
    assert wanted >= {"simulate", "evaluate", "paper", "benchmark", "sensitivity"}
    assert wanted <= names(build_app()), "reinstall with `make install`: the entry points changed"


@pytest.mark.parametrize("command", ["simulate", "evaluate", "paper", "benchmark", "demo", "sensitivity"])
def test_commands_of_lab_have_help(command: str) -> None:
    done = CliRunner().invoke(build_app(), [command, "--help"])
    assert done.exit_code == 0
    assert "Usage" in done.output


def test_another_distribution_adds_a_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = names(build_app())
    installed(tmp_path, monkeypatch, {"greet": "greeting:register"}, {"greeting": GOOD})
    app = build_app()
    assert names(app) == before | {"greet"}
    assert CliRunner().invoke(app, ["greet", "Europa"]).output == "hello Europa\n"


@pytest.mark.parametrize(
    ("module", "text", "reported"),
    [
        ("needing", "import a_package_that_is_missing", "a_package_that_is_missing"),
        ("withextra", "import a_package_that_is_missing", r"pip install 'plugin\[withextra\]'"),
        ("nothing", "", "register"),
        ("broken", "def register(", "never closed"),
    ],
)
def test_a_command_that_cannot_be_loaded_says_what_to_install_and_hinders_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, module: str, text: str, reported: str
) -> None:
    installed(
        tmp_path,
        monkeypatch,
        {"bad": f"{module}:register", "greet": "greeting:register"},
        {module: text, "greeting": GOOD},
    )
    app = build_app()
    assert CliRunner().invoke(app, ["greet", "Io"]).output == "hello Io\n"
    for arguments in (["bad"], ["bad", "projection", "--json"], ["bad", "--help"]):
        error = CliRunner().invoke(app, arguments).exception
        assert isinstance(error, RefusedError)
        assert error.reason.startswith("command-unusable: `planetpose bad`")
        assert re.search(reported, error.reason)
        assert "pip install 'plugin" in error.reason


def test_without_lab_its_commands_say_so_and_the_others_work(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [name for name in sys.modules if name.partition(".")[0] == "lab"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "lab", None)
    app = build_app()
    assert CliRunner().invoke(app, ["correct", "--help"]).exit_code == 0
    error = CliRunner().invoke(app, ["simulate", "europa57", "--out", "sim"]).exception
    assert isinstance(error, RefusedError)
    assert "pip install 'planetpose[lab]'" in error.reason


def test_a_name_that_is_taken_stays_with_its_owner(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    installed(tmp_path, monkeypatch, {"correct": "greeting:register"}, {"greeting": GOOD})
    app = build_app()
    assert "greet" not in names(app)
    assert "'correct' is taken" in capsys.readouterr().err
