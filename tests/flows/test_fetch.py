"""Files are fetched whole and checked, or not at all; a bad archive never stops the others."""

import hashlib
import json
import multiprocessing
import os
import signal
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from bad_server import CONTENT, Seen, running_archive
from typer.testing import CliRunner

from catalog.fetch import FetchSettings, Item, Outcome, planned_items
from catalog.fetch.item import INCOMING
from catalog.fetch.many import fetch_items, summary_of
from catalog.fetch.rate import RateLimit
from catalog.lists import ImageEntry, ImageList, write_image_list
from flows.cli import build_app

SHA256 = hashlib.sha256(CONTENT).hexdigest()
QUICK = FetchSettings(
    attempts=3, first_wait_s=0, longest_wait_s=0.05, stall_timeout_s=2.0, requests_per_s=500, largest_bytes=3_000_000
)


@pytest.fixture(scope="module")
def archive() -> Iterator[tuple[str, Seen]]:
    """A misbehaving archive."""
    with running_archive() as found:
        yield found


def item(base: str, behaviour: str, sha256: str | None = SHA256, name: str = "f.img") -> Item:
    return Item(behaviour, f"{base}/{behaviour}/{name}", f"host/{behaviour}/{name}", sha256)


def fetched(folder: Path, *items: Item, settings: FetchSettings = QUICK) -> list[Outcome]:
    return fetch_items(list(items), folder, settings, lambda _: None)


def files_of(folder: Path) -> list[str]:
    """What a reader of the archive folder sees: parts of files are not among it."""
    found = [path for path in folder.rglob("*") if path.is_file() and INCOMING not in path.parts]
    return sorted(path.relative_to(folder).as_posix() for path in found if path.name != "fetched.json")


def test_what_passes_is_tried_again_and_the_file_is_whole(archive: tuple[str, Seen], tmp_path: Path) -> None:
    base, seen = archive
    names = ("good", "twice-503", "truncates-once", "stalls-once", "elsewhere")
    outcomes = fetched(tmp_path, *(item(base, name) for name in names))
    assert [(o.status, o.checked) for o in outcomes] == [("fetched", True)] * 5, outcomes
    assert [o.attempts for o in outcomes] == [1, 3, 2, 2, 3]
    assert all((tmp_path / o.item.path).read_bytes() == CONTENT for o in outcomes)
    assert ("truncates-once", "bytes=70000-") in seen.ranges
    assert ("stalls-once", "bytes=40000-") in seen.ranges
    assert list((tmp_path / INCOMING).iterdir()) == []


@pytest.mark.parametrize(
    ("behaviour", "sha256", "reason", "requests"),
    [
        ("gone", SHA256, "http-404", 1),
        ("always-503", SHA256, "http-503", 3),
        ("truncates", SHA256, "connection", 3),
        ("wrong-bytes", SHA256, "checksum", 3),
        ("page", None, "page", 1),
        ("endless", None, "too-large", 1),
        ("chunks-cut", None, "connection", 3),
        ("huge", None, "too-large", 1),
        ("unsaid", None, "length-unknown", 1),
        ("gzip", SHA256, "encoded", 1),
        ("drops", None, "connection", 3),
        ("trickles", SHA256, "slow", 3),
    ],
)
def test_what_does_not_pass_fails_alone_and_leaves_no_file(
    archive: tuple[str, Seen], tmp_path: Path, behaviour: str, sha256: str | None, reason: str, requests: int
) -> None:
    base, seen = archive
    before = seen.requests[behaviour]
    settings = QUICK.model_copy(update={"slowest_bytes_per_s": 1000.0})
    bad, good = fetched(tmp_path, item(base, behaviour, sha256), item(base, "good"), settings=settings)
    assert (bad.status, good.status) == ("failed", "fetched")
    assert str(bad.reason).startswith(f"{reason}: "), bad.reason
    assert seen.requests[behaviour] - before == requests
    assert files_of(tmp_path) == ["host/good/f.img"]
    found = summary_of([bad, good])
    assert (found["failed"], found["fetched"], list(found["failures"])) == (1, 1, [behaviour])


def test_a_file_that_changes_between_two_attempts_is_begun_anew(archive: tuple[str, Seen], tmp_path: Path) -> None:
    (outcome,) = fetched(tmp_path, item(archive[0], "changes", None))
    assert outcome.status == "fetched"
    assert (tmp_path / outcome.item.path).read_bytes() == CONTENT[::-1]
    assert not outcome.checked


def test_a_server_that_is_not_there_is_a_failed_item(tmp_path: Path) -> None:
    (outcome,) = fetched(tmp_path, Item("x", "http://127.0.0.1:9/x.img", "host/x.img"))
    assert outcome.status == "failed"
    assert "connection" in str(outcome.reason)


def test_a_second_run_asks_for_nothing_and_a_damaged_file_is_got_again(
    archive: tuple[str, Seen], tmp_path: Path
) -> None:
    base, seen = archive
    wanted = item(base, "good", None)
    fetched(tmp_path, wanted)
    count = seen.requests["good"]
    (again,) = fetched(tmp_path, wanted)
    assert (again.status, again.sha256, seen.requests["good"]) == ("present", SHA256, count)
    (tmp_path / wanted.path).write_bytes(CONTENT[:-1])
    (third,) = fetched(tmp_path, wanted)
    assert (third.status, seen.requests["good"]) == ("fetched", count + 1)
    assert (tmp_path / wanted.path).read_bytes() == CONTENT


def test_a_part_of_an_earlier_run_is_continued(archive: tuple[str, Seen], tmp_path: Path) -> None:
    base, seen = archive
    one = QUICK.model_copy(update={"attempts": 1})
    seen.requests["truncates-once"] = 0
    (first,) = fetched(tmp_path, item(base, "truncates-once"), settings=one)
    assert (first.status, files_of(tmp_path)) == ("failed", [])
    seen.ranges.clear()
    (second,) = fetched(tmp_path, item(base, "truncates-once"), settings=one)
    assert second.status == "fetched"
    assert seen.ranges == [("truncates-once", "bytes=70000-")]


def fetch_slowly(base: str, folder: Path) -> None:
    os.setsid()
    settings = FetchSettings(attempts=1, stall_timeout_s=30, requests_per_s=500)
    fetch_items([item(base, "trickles")], folder, settings, lambda _: None)


def test_a_fetch_that_is_killed_leaves_no_file_and_another_takes_over(
    archive: tuple[str, Seen], tmp_path: Path
) -> None:
    base, seen = archive
    before = seen.requests["trickles"]
    process = multiprocessing.get_context("fork").Process(target=fetch_slowly, args=(base, tmp_path))
    process.start()
    while seen.requests["trickles"] == before:
        assert process.is_alive()
        time.sleep(0.02)
    (meanwhile,) = fetched(tmp_path, item(base, "trickles"))
    assert "busy" in str(meanwhile.reason)
    os.kill(int(process.pid or 0), signal.SIGKILL)
    process.join()
    assert files_of(tmp_path) == []
    wanted = Item("x", f"{base}/good/f.img", "host/trickles/f.img", SHA256)
    (after,) = fetched(tmp_path, wanted)
    assert after.status == "fetched"
    assert (tmp_path / "host/trickles/f.img").read_bytes() == CONTENT


def test_requests_to_one_host_are_spaced() -> None:
    rate, started = RateLimit(20), time.monotonic()
    for _ in range(4):
        rate.wait("http://one/x")
    rate.wait("http://two/x")
    assert time.monotonic() - started >= 0.14


def small_list(folder: Path, **changes: str) -> Path:
    rows = {"image": "pds-rings:volumes/A/good/a.img", "label": "pds-rings:volumes/A/gone/a.lbl"} | changes
    entries = (ImageEntry(product="a", kernels=("naif:good/k.bsp",), **rows), ImageEntry(product="b", image="b.img"))
    write_image_list(ImageList(name="small", entries=entries), folder / "small.toml")
    return folder / "small.toml"


def test_the_command_fetches_from_a_mirror_and_says_how_it_went(
    archive: tuple[str, Seen], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    catalog = small_list(tmp_path)
    arguments = ["fetch", str(catalog), "--mirror", archive[0], "--dest", str(tmp_path / "got"), "--attempts", "1"]
    done = CliRunner().invoke(build_app(), [*arguments, "--json"])
    *lines, summary = [json.loads(line) for line in capfd.readouterr().out.splitlines()]
    assert done.exit_code == 1
    assert [line["status"] for line in lines] == ["fetched", "failed", "fetched"]
    assert summary["summary"]["failures"] == {
        "pds-rings:volumes/A/gone/a.lbl": "http-404: the server says 404 Not Found"
    }
    assert files_of(tmp_path / "got") == ["naif/good/k.bsp", "pds-rings/volumes/A/good/a.img"]
    again = CliRunner().invoke(build_app(), [*arguments, "--what", "images", "--what", "kernels"])
    assert again.exit_code == 0
    assert "2 there already, 0 failed" in capfd.readouterr().out


def test_an_offline_mirror_is_a_folder(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    catalog = small_list(tmp_path)
    for name in ("pds-rings/volumes/A/good/a.img", "naif/good/k.bsp"):
        (tmp_path / "disk" / name).parent.mkdir(parents=True)
        (tmp_path / "disk" / name).write_bytes(CONTENT)
    done = CliRunner().invoke(
        build_app(), ["fetch", str(catalog), "--mirror", str(tmp_path / "disk"), "--dest", str(tmp_path / "got")]
    )
    assert done.exit_code == 1
    assert "not-in-mirror" in capfd.readouterr().out
    assert files_of(tmp_path / "got") == ["naif/good/k.bsp", "pds-rings/volumes/A/good/a.img"]


def test_wrong_usage_is_said(tmp_path: Path) -> None:
    catalog = str(small_list(tmp_path))
    for wrong in (["--what", "pictures"], ["--only", "zzz*"]):
        assert CliRunner().invoke(build_app(), ["fetch", catalog, *wrong]).exit_code == 2


def test_kernels_that_several_images_share_are_fetched_once() -> None:
    entries = tuple(ImageEntry(product=f"p{i}", image=f"naif:x/{i}.img", kernels=("voyager1-jupiter",)) for i in (1, 2))
    items = planned_items(ImageList(name="l", entries=entries), "http://mirror/root/")
    kernels = [found for found in items if found.location.endswith("vgr1_jup230.bsp")]
    assert len(kernels) == 1
    assert kernels[0].source == "http://mirror/root/naif/VOYAGER/kernels/spk/vgr1_jup230.bsp"
    assert kernels[0].products == ("p1", "p2")
    assert len(str(kernels[0].sha256)) == 64
