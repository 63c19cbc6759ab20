"""Plugins in this process: what their entry points may give, and what of it is refused."""

import sys
from collections.abc import Callable, Iterator
from importlib.metadata import EntryPoint
from pathlib import Path
from types import ModuleType
from typing import Annotated, Any

import numpy as np
import pytest
from pydantic import BaseModel, ValidationError

from catalog import camera, plugins, readers, target
from catalog.choice import Choice
from catalog.errors import RefusedError
from catalog.plugins import CAMERAS, LAWS, READERS, REGISTRATIONS, TARGETS, Plugin
from catalog.readers.plugged import PluggedReader
from catalog.readers.reading import Reading
from flows.trace import code_changed
from tasks.plugin_code import plugin_version, plugins_in
from tasks.point import registration
from tasks.registry import POINT
from tasks.simulate import photometry

CACHED = (
    plugins.plugins_of,
    plugins.plugin_named,
    camera.known_cameras,
    target.known_targets,
    readers.plugin_readers,
    plugin_version,
    registration._plugged,
    photometry._plugged,
)
CAMERA = {"name": "mine", "size_px": [10, 10], "centre_px": [4.5, 4.5], "focal_length_px": 100.0}
Install = Callable[[str, dict[str, Any]], ModuleType]


@pytest.fixture
def install(monkeypatch: pytest.MonkeyPatch) -> Iterator[Install]:
    """Entry points of one group, by name, for objects in a module that is made for them."""
    found: list[EntryPoint] = []

    def entry_points(group: str) -> list[EntryPoint]:
        return [entry for entry in found if entry.group == group]

    def add(group: str, given: dict[str, Any]) -> ModuleType:
        module = ModuleType("given_by_plugins")
        for name, value in given.items():
            setattr(module, name, value)
            found.append(EntryPoint(name, f"given_by_plugins:{name}", group))
        monkeypatch.setitem(sys.modules, "given_by_plugins", module)
        return module

    monkeypatch.setattr(plugins, "entry_points", entry_points)
    for cached in CACHED:
        cached.cache_clear()
    yield add
    for cached in CACHED:
        cached.cache_clear()


def toml(folder: Path, name: str) -> Path:
    path = folder / f"{name}.toml"
    path.write_text(f'name = "{name}"\nsize_px = [10, 10]\ncentre_px = [4.5, 4.5]\nfocal_length_px = 100.0\n')
    return path


def test_a_camera_is_given_as_file_folder_content_sequence_function_or_package(
    install: Install, tmp_path: Path
) -> None:
    folder = tmp_path / "folder"
    folder.mkdir()
    toml(folder, "c"), toml(folder, "d")
    package = ModuleType("package")
    package.__path__ = [str(tmp_path / "package")]
    (tmp_path / "package").mkdir()
    toml(tmp_path / "package", "i")
    given = {
        "file": toml(tmp_path, "a"),
        "text": str(toml(tmp_path, "b")),
        "folder": folder,
        "content": CAMERA | {"name": "E"},
        "several": [toml(tmp_path, "f"), CAMERA | {"name": "g"}],
        "function": lambda: (CAMERA | {"name": "h"},),
        "package": package,
    }
    install(CAMERAS, given)
    assert set(camera.known_cameras()) >= set("abcdefghi")
    assert camera.find_camera("e").name == "E"


@pytest.mark.parametrize(
    ("given", "reported"),
    [
        (CAMERA | {"size_px": 3}, "camera-file-invalid: camera file of given_by_plugins: size_px"),
        (Path("nowhere.toml"), "camera-file-unreadable"),
        ([], "gives no TOML file"),
        (7, "gives int instead of the path"),
        (lambda: 1 / 0, "cannot be used (ZeroDivisionError: division by zero)"),
        (CAMERA | {"name": "galileo-ssi"}, "the name is taken"),
    ],
)
def test_a_camera_that_cannot_be_used_is_reported_and_the_others_stay(
    given: Any, reported: str, install: Install, caplog: pytest.LogCaptureFixture
) -> None:
    install(CAMERAS, {"bad": given, "good": CAMERA})
    before = camera.read_camera_file(camera.CAMERA_FOLDER / "galileo-ssi.toml")
    assert camera.known_cameras()["galileo-ssi"] == before
    assert camera.known_cameras()["mine"].focal_length_px == 100.0
    assert reported in caplog.text
    assert caplog.text.count("planetpose: ") == 1


def test_a_targets_alias_takes_nothing_from_the_catalog(install: Install) -> None:
    content = {"name": "Mine", "naif_id": 9, "radii_km": [3.0, 2.0, 1.0], "aliases": ["EUROPA", "m1"]}
    install(TARGETS, {"mine": content})
    assert target.find_target("europa").naif_id == 502
    assert target.find_target("M1") is target.find_target("mine")
    assert target.known_target("nobody") is None


class MyReader:
    """Reads what begins with `MINE`."""

    def __init__(self, gives: Any = None) -> None:
        self.gives = gives

    def recognises(self, head: bytes, path: Path) -> bool:
        """By the first bytes."""
        return head.startswith(b"MINE")

    def read(self, path: Path) -> Any:
        """What it was made with."""
        if isinstance(self.gives, Exception):
            raise self.gives
        if self.gives is not None:
            return self.gives
        return Reading("mine", np.eye(30) + float(path.stat().st_size), targets=("EUROPA",))


def test_a_readers_file_is_read_by_it_and_every_other_by_ours(install: Install, tmp_path: Path) -> None:
    install(READERS, {"mine": MyReader})
    path = tmp_path / "image.dat"
    path.write_bytes(b"MINE")
    assert readers.plugin_reader_of(path) == "mine"
    frame = readers.read_frame(path)
    assert (frame.format, frame.target) == ("mine", "europa")
    path.write_bytes(b"YOURS")
    assert readers.plugin_reader_of(path) is None
    with pytest.raises(RefusedError, match="it is a text or a detached label"):
        readers.read_frame(path)


@pytest.mark.parametrize(
    ("gives", "reported"),
    [
        (KeyError("LINES"), "cannot read image .*KeyError: 'LINES'"),
        (np.eye(3), "gives ndarray for image .* instead of a Reading"),
        (Reading("mine", np.zeros(3)), "instead of a grey picture"),
        (Reading("mine", np.zeros((3, 3), complex)), "instead of a grey picture"),
        (Reading("mine", np.eye(30), noise=np.ones((2, 2), np.float32)), r"gives noise \(2, 2\)"),
        (RefusedError("image-unreadable", "its own words."), "^its own words"),
    ],
)
def test_a_readers_faults_are_the_images_refusal(gives: Any, reported: str, install: Install, tmp_path: Path) -> None:
    install(READERS, {"mine": MyReader(gives)})
    (tmp_path / "image.dat").write_bytes(b"MINE")
    with pytest.raises(RefusedError, match=reported):
        readers.read_frame(tmp_path / "image.dat")


def test_a_reader_that_fails_over_another_file_is_reported_and_not_used(
    install: Install, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    class Bad(MyReader):
        def recognises(self, head: bytes, path: Path) -> bool:
            return head[100] == 7

    install(READERS, {"bad": Bad, "no_reader": object()})
    (tmp_path / "image.dat").write_bytes(b"YOURS")
    assert readers.plugin_reader_of(tmp_path / "image.dat") is None
    assert "IndexError" in caplog.text
    assert "has no functions `recognises` and `read`" in caplog.text
    assert isinstance(readers.plugin_readers()["bad"], PluggedReader)


NAME = Annotated[str, Choice("law", LAWS, ("ours",))]


class Inner(BaseModel):
    """Names in sequences."""

    names: tuple[NAME, ...] = ()
    maybe: NAME | None = None


class Outer(BaseModel):
    """Names in models in it."""

    name: NAME = "ours"
    inner: Inner = Inner()
    by_name: dict[str, Inner] = {}
    text: str = "flat"


def test_a_choice_takes_known_names_and_finds_those_of_plugins_in_inputs(install: Install) -> None:
    install(LAWS, {"flat": np.sqrt, "steep": np.square, "ours": np.cbrt})
    assert plugins_in(Outer()) == {}
    assert set(plugins_in(Outer(name="flat"))) == {f"{LAWS}/flat"}
    deep = Outer(inner=Inner(names=("ours", "steep")), by_name={"a": Inner(maybe="flat")})
    assert set(plugins_in(deep)) == {f"{LAWS}/flat", f"{LAWS}/steep"}
    with pytest.raises(ValidationError, match="there is no law 'none'; known are ours, flat, steep"):
        Outer(inner=Inner(names=("none",)))
    assert Outer.model_json_schema()["properties"]["name"]["enum"] == ["ours", "flat", "steep"]


def test_what_a_law_or_a_registration_gives_is_checked(install: Install) -> None:
    cosines = np.full((2, 3), 0.5, np.float32)
    install(LAWS, {"short": lambda mu0, mu, phase: mu0[:1]})
    with pytest.raises(RefusedError, match="plugin law 'short'"):
        photometry.laws(["short"])[0](cosines, cosines, 30.0)
    install(LAWS, {"nan": lambda mu0, mu, phase: mu0 * np.nan})
    plugins.plugins_of.cache_clear(), plugins.plugin_named.cache_clear()
    with pytest.raises(RefusedError, match="not finite"):
        photometry.bases_of("nan")[0](cosines, cosines, 30.0)
    install(REGISTRATIONS, {"far": lambda match: registration.Shift(np.array([np.nan, 0]), None, 1, 1.0)})
    with pytest.raises(RefusedError, match="two finite pixels"):
        registration.find_registration("far")(None)  # type: ignore[arg-type]
    for find in (registration.find_registration, photometry.bases_of):
        with pytest.raises(KeyError):
            find("none")
    assert photometry.bases_of("lambert") == (photometry.lambert,)


def test_two_plugins_of_one_name_are_reported(install: Install, caplog: pytest.LogCaptureFixture) -> None:
    install(LAWS, {"flat": np.sqrt})
    install(LAWS, {"flat": np.square})
    assert [plugin.name for plugin in plugins.plugins_of(LAWS)] == ["flat"]
    assert "the name is that of" in caplog.text
    assert isinstance(plugins.plugin_named(LAWS, "flat"), Plugin)


class Kind:
    """A step whose inputs are `Outer`."""

    inputs = Outer
    code = POINT.code
    code_for = staticmethod(POINT.code_for)


def test_the_code_of_a_step_counts_the_plugins_that_its_inputs_name(
    install: Install, monkeypatch: pytest.MonkeyPatch
) -> None:
    install(LAWS, {"flat": np.sqrt})
    plain, plugged = Outer(text="flat"), Outer(name="flat")
    assert POINT.code_for(plain) == POINT.code != POINT.code_for(plugged)
    kind: Any = Kind
    entry = {"code": POINT.code_for(plugged), "inputs": plugged.model_dump()}
    assert not code_changed(kind, entry)
    assert code_changed(kind, entry | {"code": POINT.code})
    monkeypatch.setattr("tasks.plugin_code.plugin_version", lambda group, name: "newer")
    assert code_changed(kind, entry)
    assert not code_changed(kind, {"code": POINT.code, "inputs": plain.model_dump()})
    monkeypatch.setattr(plugins, "entry_points", lambda group: [])
    for cached in CACHED[:2]:
        cached.cache_clear()
    assert code_changed(kind, entry)  # it is gone
