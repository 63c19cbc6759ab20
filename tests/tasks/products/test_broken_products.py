"""One product that is broken, or leads out of the store, is named; the others are exported, checked and reported."""

import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from small_product import small_publication
from typer.testing import CliRunner

from flows.cli import build_app
from tasks.publish import publish
from tasks.publish.contained import faults_of_place
from tasks.publish.index import open_index

Run = Callable[[str, Path, Path], tuple[int, str]]
GOOD, BAD = ("bild_ä", "C0001"), "C0002"
SECRET = "nobody may read this"


@pytest.fixture(scope="module")
def template(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("template")
    for name in (*GOOD, BAD):
        publish(small_publication(name, size=48, radius_px=20.0), folder)
    return folder


@pytest.fixture
def store(template: Path, tmp_path: Path) -> Path:
    (tmp_path / "secret").write_text(SECRET)
    shutil.copytree(template / BAD, tmp_path / "outside" / BAD)
    return Path(shutil.copytree(template, tmp_path / "store"))


def rewritten(path: Path, change: Callable[[dict], None]) -> None:
    content = json.loads(path.read_text())
    change(content)
    path.write_text(json.dumps(content))


def replaced_by_link(path: Path, target: Path) -> None:
    shutil.rmtree(path) if path.is_dir() else path.unlink()
    path.symlink_to(target)


def replaced_by_pipe(path: Path) -> None:
    path.unlink()
    os.mkfifo(path)


BREAKAGES: dict[str, Callable[[Path], None]] = {
    "metadata are a list": lambda p: (p / "cube.zarr/zarr.json").write_text("[1, 2]"),
    "attributes are text": lambda p: rewritten(p / "cube.zarr/zarr.json", lambda c: c.update(attributes="x")),
    "provenance is a number": lambda p: rewritten(
        p / "cube.zarr/zarr.json", lambda c: c["attributes"].update(provenance="3")
    ),
    "time is no time": lambda p: rewritten(p / "cube.zarr/zarr.json", lambda c: c["attributes"].update(utc="today")),
    "pose is no pose": lambda p: rewritten(
        p / "cube.zarr/zarr.json", lambda c: c["attributes"].update(pose_after="{}")
    ),
    "metadata are nested": lambda p: (p / "cube.zarr/zarr.json").write_text("[" * 100_000),
    "planes are gone": lambda p: shutil.rmtree(p / "cube.zarr/emission"),
    "cube links out": lambda p: replaced_by_link(p / "cube.zarr", p.parents[1] / "outside" / BAD / "cube.zarr"),
    "product links out": lambda p: replaced_by_link(p, p.parents[1] / "outside" / BAD),
    "head is a pipe": lambda p: replaced_by_pipe(p / "cube.zarr/zarr.json"),
    "a chunk is a pipe": lambda p: replaced_by_pipe(p / "cube.zarr/emission/c/0/0"),
    "a chunk is a device": lambda p: replaced_by_link(p / "cube.zarr/emission/zarr.json", Path("/dev/zero")),
}  # fmt: skip
ALL, SOME = tuple(BREAKAGES), ("attributes are text", "cube links out", "head is a pipe", "a chunk is a device")
COMMANDS = {
    "table": ["export", "--format", "csv"],
    "fits": ["export", "--format", "fits", "--format", "csv", "--format", "parquet"],
    "maps": ["export", "--format", "cog", "--format", "geotiff", "--format", "zarr-map", "--format", "stac"],
    "check": ["check"],
    "planes": ["planes"],
    "kernels": ["kernels", "--no-kernels", "--no-check", "--per-image"],
    "report": ["report", "--picture", "overlay", "-q"],
}


# What a command does not look at does not stop it; that chunks are missing, which reads as NaN, is what `check` is for.
NOT_REQUESTED = {
    "provenance is a number": ("table", "maps"),
    "time is no time": ("table",),
    "planes are gone": ("table",),
}


@pytest.fixture
def run(capfd: pytest.CaptureFixture[str]) -> Run:
    def do(command: str, store: Path, out: Path) -> tuple[int, str]:
        """Exit status and what was printed, also by the streams that commands open anew."""
        name, *options = COMMANDS[command]
        place = [] if name in ("check", "planes") else ["--out", str(out)]
        capfd.readouterr()
        done = CliRunner().invoke(build_app(), [name, str(store), *options, *place])
        assert done.exception is None or isinstance(done.exception, SystemExit), done.exception
        return done.exit_code, done.output + "".join(capfd.readouterr())

    return do


@pytest.mark.parametrize("command", [name for name in COMMANDS if name != "table"])
def test_products_with_names_beyond_ascii_are_exported(command: str, store: Path, tmp_path: Path, run: Run) -> None:
    status, reported = run(command, store, tmp_path / "out")
    assert status == 0, reported
    if command != "check":
        made = " ".join(str(path) for path in (*(tmp_path / "out").rglob("*"), *store.rglob("*")))
        assert "bild_ä" in made


@pytest.mark.parametrize(
    ("command", "breakage"),
    [(command, breakage) for command in ("table", "check") for breakage in ALL]
    + [(command, breakage) for command in ("planes", "report") for breakage in SOME],
)
def test_a_broken_product_is_named_and_the_others_go_on(
    command: str, breakage: str, store: Path, tmp_path: Path, run: Run
) -> None:
    BREAKAGES[breakage](store / BAD)
    status, reported = run(command, store, tmp_path / "out")
    if command not in NOT_REQUESTED.get(breakage, ()):
        assert (status, BAD in reported) == (1, True), reported
    assert "bug: " not in reported
    if command == "table":
        assert {path.name for path in (tmp_path / "out").glob("*.csv")} >= {f"{name}.csv" for name in GOOD}
    if command == "planes":
        assert all((store / name / "planes.zarr").is_dir() for name in GOOD)
    if command == "report":
        assert {path.stem for path in (tmp_path / "out/images").iterdir()} >= set(GOOD)
        assert all((tmp_path / f"out/pictures/{name}-overlay.png").is_file() for name in GOOD)


@pytest.mark.parametrize("command", ["maps", "kernels"])
@pytest.mark.parametrize("breakage", ["metadata are a list", "provenance is a number", "product links out"])
def test_neither_do_maps_and_kernels_stop(command: str, breakage: str, store: Path, tmp_path: Path, run: Run) -> None:
    BREAKAGES[breakage](store / BAD)
    status, reported = run(command, store, tmp_path / "out")
    if command not in NOT_REQUESTED.get(breakage, ()):
        assert (status, BAD in reported) == (1, True), reported
    assert len([path for path in (tmp_path / "out").rglob("*") if "C0001" in path.name]) > 0


@pytest.mark.parametrize("breakage", BREAKAGES)
def test_the_index_has_all_others(breakage: str, store: Path) -> None:
    BREAKAGES[breakage](store / BAD)
    index = open_index(store).set_index("product")
    assert list(index.loc[list(GOOD), "status"]) == ["ok", "ok"]
    if BAD in index.index and breakage != "planes are gone":
        assert index.loc[BAD, "status"] == "unreadable"
        assert index.loc[BAD, "reason"]


@pytest.mark.parametrize("name", ["overlay.png", "result.json"])
def test_what_links_out_of_the_store_gets_into_no_report_or_export(
    name: str, store: Path, tmp_path: Path, run: Run
) -> None:
    open_index(store)  # as it was before
    replaced_by_link(store / BAD / name, tmp_path / "secret")
    status, reported = run("report", store, tmp_path / "out")
    assert status == 1
    assert str(tmp_path / "secret") in reported
    for path in (path for path in (tmp_path / "out").rglob("*") if path.is_file()):
        assert SECRET.encode() not in path.read_bytes()
    assert run("table", store, tmp_path / "out")[0] == 1


def test_links_within_the_store_are_followed(store: Path, tmp_path: Path, run: Run) -> None:
    objects = store / ".objects"
    objects.mkdir()
    shutil.move(store / BAD / "overlay.png", objects / "1")
    (store / BAD / "overlay.png").symlink_to(objects / "1")
    shutil.move(store / BAD, objects / BAD)
    (store / BAD).symlink_to(Path(".objects") / BAD)
    assert list(faults_of_place(store / BAD)) == []
    assert run("report", store, tmp_path / "out")[0] == 0
    assert (tmp_path / f"out/pictures/{BAD}-overlay.png").is_file()


@pytest.mark.parametrize("name", [b"not \xff utf-8", b"new\nline"])
def test_a_folder_whose_name_is_no_text_spoils_nothing(name: bytes, store: Path, tmp_path: Path, run: Run) -> None:
    shutil.copytree(store / BAD, store / os.fsdecode(name))
    assert sorted(open_index(store)["status"]) == ["ok", "ok", "ok", "unreadable"]
    for command in ("table", "report"):
        assert run(command, store, tmp_path / command)[0] == 1
    assert len(list((tmp_path / "table").glob("*.csv"))) == 3
