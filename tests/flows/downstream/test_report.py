"""The report of a store: whole without the store, without a network, and in a browser."""

import json
import os
import shutil
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlparse

import pytest

sys.path.insert(0, str(Path(__file__).parent))
from lab.page.browser import Page, browser_page, find_browser
from tasks.pictures.store_figures import QUANTITIES
from tasks.report.pictures import last_change
from tasks.report.write import Report, write_report

DAMAGED, FINE, DOUBTFUL = "BROKEN", "PHASE_012.0", "PHASE_070.0"
REASON = "<b>limb</b> & similarity disagree"


@pytest.fixture(scope="module")
def report(lunar_lambert_store, tmp_path_factory) -> Report:
    store = tmp_path_factory.mktemp("reported") / "my store"
    for product in (FINE, DOUBTFUL):
        shutil.copytree(lunar_lambert_store / product, store / product)
    (store / DAMAGED / "cube.zarr").mkdir(parents=True)
    (store / DAMAGED / "cube.zarr" / "zarr.json").write_text("{")
    result = store / DOUBTFUL / "result.json"
    result.write_text(json.dumps(json.loads(result.read_text()) | {"status": "doubtful", "reason": REASON}))
    written = write_report(store, tmp_path_factory.mktemp("report"))
    shutil.rmtree(store)
    return written


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    program = find_browser()
    if program is None:
        pytest.skip("no Chromium or Chrome is installed")
    with browser_page(program, tmp_path_factory.mktemp("browser")) as page:
        yield page


class Links(HTMLParser):
    """Everything that a page refers to, and pictures without a text."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.targets: list[str] = []
        self.unreported: list[str] = []
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attrs):
        given = dict(attrs)
        self.targets += [given[name] for name in ("href", "src") if name in given]
        if tag == "img" and not given.get("alt"):
            self.unreported.append(given["src"])


def pages_of(report: Report) -> list[Path]:
    return [report.page, *sorted((report.page.parent / "images").glob("*.html"))]


def test_every_image_has_a_page_and_every_link_is_relative_and_leads_somewhere(report) -> None:
    pages = pages_of(report)
    assert len(pages) == 1 + report.images == 4
    for path in pages:
        links = Links(path)
        assert links.unreported == []
        for target in links.targets:
            if target == "data:,":
                continue
            parts = urlparse(target)
            assert (parts.scheme, parts.netloc, target[0] == "/") == ("", "", False), target
            assert (path.parent / unquote(parts.path)).is_file(), f"{path.name}: {target}"


def test_a_range_factor_is_reported_to_its_sixth_digit() -> None:
    from tasks.report.page import environment

    digits = {quantity.name: quantity.digits for quantity in QUANTITIES}
    assert environment().filters["figure_number"](1.000307, digits["range_factor"]) == "1.00031"


def test_pages_know_no_machine_path(report) -> None:
    for path in pages_of(report):
        assert str(report.page.parent) not in path.read_text()
        assert "my store" in path.read_text()


def test_verdicts_reasons_and_provenance_are_reported_and_escaped(report) -> None:
    doubtful = (report.page.parent / "images" / f"{DOUBTFUL}.html").read_text()
    assert "&lt;b&gt;limb&lt;/b&gt; &amp; similarity disagree" in doubtful
    assert "image.sha256" in doubtful
    assert "&#34;profile&#34;: &#34;planted&#34;" in doubtful
    damaged = (report.page.parent / "images" / f"{DAMAGED}.html").read_text()
    assert "unreadable" in damaged
    assert "cannot be read" in damaged
    assert "3 images: 1 ok, 1 doubtful, 1 unreadable." in report.page.read_text()


def test_pictures_that_cannot_be_drawn_are_explained_and_the_others_are_there(report) -> None:
    drawn = sorted(path.name for path in (report.page.parent / "pictures").glob("*.png"))
    for product in (FINE, DOUBTFUL):
        assert {f"{product}-{kind}.png" for kind in ("small", "overlay", "residual", "planes")} <= set(drawn)
    assert not any(DAMAGED in name for name in drawn)
    assert report.missing == {}
    assert list(report.broken) == ["BROKEN"]


def test_a_product_is_as_young_as_its_youngest_part(tmp_path: Path) -> None:
    (tmp_path / "result.json").write_text("{}")
    published = last_change(tmp_path)
    os.utime(tmp_path / "result.json", (published + 100, published + 100))
    assert last_change(tmp_path) == published + 100


BROKEN_PICTURES = """Promise.all([...document.images].map(async image => {
  image.loading = "eager";
  try { await image.decode(); } catch { return image.src; }
  return image.naturalWidth ? "" : image.src;
})).then(all => all.filter(Boolean))"""

# Boxes of all text, cut to what scrolls; two of them may not share more than a hair.
OVERLAPS = """(() => {
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT), boxes = [];
  while (walker.nextNode()) {
    const node = walker.currentNode, parent = node.parentElement;
    if (!node.data.trim() || parent.closest("script, style, details:not([open]) pre")) continue;
    const range = document.createRange();
    range.selectNodeContents(node);
    const scroll = parent.closest(".scroll")?.getBoundingClientRect();
    for (const box of range.getClientRects()) {
      const right = Math.min(box.right, scroll ? scroll.right : Infinity);
      if (right > box.left) boxes.push([box.left, box.top + 2, right, box.bottom - 2, node]);
    }
  }
  const faults = [];
  boxes.forEach((a, i) => boxes.slice(i + 1).forEach(b => {
    const wide = Math.min(a[2], b[2]) - Math.max(a[0], b[0]), high = Math.min(a[3], b[3]) - Math.max(a[1], b[1]);
    if (a[4] !== b[4] && wide > 1 && high > 1) faults.push(a[4].data.trim() + " / " + b[4].data.trim());
  }));
  return faults;
})()"""
SPILLED = """[...document.querySelectorAll("h1, h2, p, td, th, figcaption, pre, summary")]
  .filter(one => one.scrollWidth > one.clientWidth + 1 && one.clientWidth).map(one => one.textContent.trim())"""
TOO_WIDE = "document.documentElement.scrollWidth - document.documentElement.clientWidth"
ROWS = """[...document.querySelectorAll("#images tbody tr")].filter(row => !row.hidden)
  .map(row => row.cells[1].textContent)"""


@pytest.mark.parametrize("width", [1400, 420])
def test_every_page_loads_in_a_browser_without_a_complaint(report, page: Page, width: int) -> None:
    for path in pages_of(report):
        page.open(path.as_uri(), width)
        page.ask("document.querySelectorAll('details').forEach(one => one.open = true)")
        assert page.ask(BROKEN_PICTURES) == [], path.name
        assert page.ask(OVERLAPS) == [], path.name
        assert page.ask(SPILLED) == [], path.name
        assert page.ask(TOO_WIDE) <= 0, path.name
        assert page.complaints == [], path.name


def test_a_click_sorts_the_table_and_unknown_values_stay_below(report, page: Page) -> None:
    page.open(report.page.as_uri())
    assert page.ask(OVERLAPS.replace("+ 2", "- 40").replace("- 2,", "+ 40,")) != []  # the check sees what it should
    click = "[...document.querySelectorAll('thead button')].find(b => b.textContent === 'phase, deg').click()"
    rising = [FINE, DOUBTFUL, DAMAGED]
    page.ask(click)
    assert page.ask(ROWS) == rising
    page.ask(click)
    assert page.ask(ROWS) == [DOUBTFUL, FINE, DAMAGED]
    assert page.ask("document.querySelector('th[aria-sort]').textContent") == "phase, deg"


def test_the_filter_hides_rows(report, page: Page) -> None:
    page.open(report.page.as_uri())
    page.ask("filter.value = 'doubtful'; filter.dispatchEvent(new Event('input'))")
    assert page.ask(ROWS) == [DOUBTFUL]
    assert page.ask("shown.textContent") == "1 of 3"


def test_a_complaint_would_be_seen(page: Page, tmp_path: Path) -> None:
    bad = tmp_path / "bad.html"
    bad.write_text("<img src='gone.png' alt='x'><script>undefinedName()</script>")
    page.open(bad.as_uri())
    assert len(page.complaints) >= 2
    assert page.ask(BROKEN_PICTURES) != []


FILTERS = {
    "phase > 50": [DOUBTFUL],
    "phase<=50 and status = ok": [FINE],
    "not status = ok": [DAMAGED, DOUBTFUL],
    "phase_01": [FINE],
    "sigma > 1e9": [],
    "utc > 1900 phase > 50": [DOUBTFUL],
}


def test_filters_of_the_page_know_numbers_and_say_what_is_wrong(report, page: Page) -> None:
    page.open(report.page.as_uri())

    def typed(text: str) -> list[str]:
        page.ask(
            f"filter = document.getElementById('filter'), filter.value = {json.dumps(text)},"
            " filter.dispatchEvent(new Event('input'))"
        )
        return sorted(page.ask(ROWS))

    for text, products in FILTERS.items():
        assert typed(text) == sorted(products), text
    assert typed("phase > much") == []
    assert "is a number" in page.ask("document.getElementById('shown').textContent")
    assert page.complaints == []


@pytest.fixture
def reported(lunar_lambert_store, tmp_path) -> Path:
    for product in (FINE, DOUBTFUL):
        shutil.copytree(lunar_lambert_store / product, tmp_path / "store" / product)
    return tmp_path


def shown_files(out: Path) -> dict[str, int]:
    return {str(path.relative_to(out)): path.stat().st_mtime_ns for path in out.rglob("*.png")} | {
        str(path.relative_to(out)): path.stat().st_mtime_ns for path in (out / "images").glob("*.html")
    }


def changed_files(before: dict[str, int], after: dict[str, int]) -> set[str]:
    return {name for name in after if after[name] != before.get(name)}


def test_only_what_would_be_another_picture_or_page_is_made_again(reported: Path) -> None:
    store, out = reported / "store", reported / "out"
    assert write_report(store, out, ("overlay", "planes")).drawn == 2
    first = shown_files(out)
    assert write_report(store, out, ("overlay", "planes")).drawn == 0
    assert shown_files(out) == first
    (out / "pictures" / f"{FINE}-planes.png").unlink()
    assert write_report(store, out, ("overlay", "planes")).drawn == 1
    second = shown_files(out)
    assert not any(DOUBTFUL in name for name in changed_files(first, second))
    result = store / DOUBTFUL / "result.json"
    result.write_text(json.dumps(json.loads(result.read_text()) | {"limb_rms_px": 0.123456}))
    assert write_report(store, out, ("overlay", "planes")).drawn == 1
    third = changed_files(second, shown_files(out))
    assert {f"pictures/{DOUBTFUL}-planes.png", f"images/{DOUBTFUL}.html", "figures/limb_rms.png"} <= third
    assert not any(FINE in name for name in third)
    shutil.copytree(store / FINE, store / "PHASE_013.0")  # a neighbour: its page follows, its pictures stay
    write_report(store, out, ("overlay", "planes"))
    assert not any(FINE in name for name in changed_files(second, shown_files(out)) if name.startswith("pictures/"))


def test_a_picture_that_could_not_be_drawn_is_tried_again(reported: Path, monkeypatch) -> None:
    from tasks.report import image

    with monkeypatch.context() as patch:
        patch.setattr(image, "drawn", lambda *_: (_ for _ in ()).throw(OSError("the disk is full")))
        assert len(write_report(reported / "store", reported / "out", ("overlay",)).missing) == 2
    written = write_report(reported / "store", reported / "out", ("overlay",))
    assert (written.missing, written.drawn) == ({}, 2)


def rows_of(count: int) -> list[list]:
    from tasks.report.page import COLUMNS

    texts = {"status": "ok", "camera": "VG1", "target": "europa", "utc": "1979-03-04T05:06:07+00:00"}

    def row(number: int) -> list:
        value = (number * 7919) % count + 0.5
        return [f"P{number:06d}", None, None, *(texts.get(column.name, value) for column in COLUMNS)]

    return [row(number) for number in range(count)]


def write_table(out: Path, count: int) -> Path:
    from collections import Counter

    from tasks.report.page import PAGE_ROWS, index_page
    from tasks.report.rows import write_rows

    rows = rows_of(count)
    write_rows(out, iter(rows))
    text = index_page(rows[:PAGE_ROWS], Counter(ok=count), [], {"written": "now", "store": "large", "made": ""})
    (out / "index.html").write_text(text)
    return out / "index.html"


def test_the_first_page_of_a_large_store_is_small(tmp_path: Path) -> None:
    page = write_table(tmp_path, 30_000)
    at_first = page.stat().st_size + (tmp_path / "rows" / "rows-0000.js").stat().st_size
    assert at_first < 1e6
    assert len(list((tmp_path / "rows").iterdir())) == 15
    write_table(tmp_path, 10)
    assert len(list((tmp_path / "rows").iterdir())) == 1


def test_a_large_table_is_paged_sorted_and_filtered_as_a_whole(page: Page, tmp_path: Path) -> None:
    page.open(write_table(tmp_path, 5000).as_uri())
    assert len(page.ask(ROWS)) == 100
    assert page.ask("place.textContent") == "1 to 100 of 5000"
    page.ask("later.click()")
    assert page.ask(ROWS)[0] == "P000100"
    page.ask("[...document.querySelectorAll('thead button')].find(b => b.textContent === 'phase, deg').click()")
    ready = "new Promise(done => {{ const look = () => {} ? done(true) : setTimeout(look, 20); look(); }})"
    assert page.ask(ready.format("document.querySelector('#images tbody td:nth-child(7)').textContent === '0.5'"))
    page.ask("filter.value = 'phase > 4990'; filter.dispatchEvent(new Event('input'))")
    assert page.ask("shown.textContent") == "10 of 5000"
    assert len(page.ask(ROWS)) == 10
    assert page.complaints == []
