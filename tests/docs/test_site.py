"""The documentation builds without a warning, needs no network, and leaves nothing out."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
FLOORS = ("catalog", "tasks", "local_server", "flows", "planetpose", "viewer", "lab")
DOCS = ROOT / "docs"
sys.path.insert(0, str(DOCS))

from building.commands import all_commands  # noqa: E402

from catalog.camera import known_cameras  # noqa: E402
from flows.result import EMPTY  # noqa: E402


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The built site; a broken link, reference or equation is an error."""
    to = tmp_path_factory.mktemp("site")
    build = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-b", "html", str(DOCS), str(to)]
    done = subprocess.run(build, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return to


def test_pages_need_no_network(site: Path) -> None:
    loaded = re.compile(r"<(?:script|img|iframe|source)[^>]+src=\"(https?:)?//|<link[^>]+stylesheet[^>]+href=\"https?:")
    pages = list(site.rglob("*.html"))
    assert len(pages) > 40
    assert [page.name for page in pages if loaded.search(page.read_text(encoding="utf-8"))] == []


def test_equations_are_drawn_by_the_browser_itself(site: Path) -> None:
    for page in ("method/project", "method/joint", "cameras/index"):
        assert "<math" in (site / f"{page}.html").read_text(encoding="utf-8")


def test_the_sidebar_lists_every_chapter_and_opens_the_own_one(site: Path) -> None:
    text = (site / "method/point.html").read_text(encoding="utf-8")
    sidebar = text.partition('class="sidebar-tree"')[2].partition("</div>")[0]
    links = re.findall(r'href="([^"]+)"', re.sub(r"<svg>.*?</svg>", "", sidebar))
    assert links[0] == "../tutorial.html"
    assert {"../guide/index.html", "index.html", "#", "joint.html", "../glossary.html"} <= set(links)
    assert [link for link in links if link.startswith(("../guide/", "../reference/", "../cameras/"))] == [
        "../guide/index.html",
        "../cameras/index.html",
        "../reference/index.html",
    ]
    deeper = (site / "reference/api/compare.html").read_text(encoding="utf-8").partition('class="sidebar-tree"')[2]
    assert re.search(r'toctree-l3 current current-page.*?href="#"', deeper, re.S)
    assert 'href="../settings.html"' in deeper


def test_the_search_knows_commands_settings_and_reasons(site: Path) -> None:
    index = (site / "searchindex.js").read_text(encoding="utf-8")
    assert all(word in index for word in ("reprocess", "edge_px", "sinc"))


def test_every_camera_has_a_page() -> None:
    assert set(known_cameras()) <= {page.stem for page in (DOCS / "cameras").glob("*.md")}


def test_every_key_of_a_result_is_explained() -> None:
    reported = set(re.findall(r"`([a-z_]+)`", (DOCS / "reference/result.md").read_text(encoding="utf-8")))
    assert set(EMPTY) <= reported


def test_every_command_is_in_the_reference(site: Path) -> None:
    page = (site / "reference/commands.html").read_text(encoding="utf-8")
    assert all(f"planetpose {words}" in page for words in all_commands())


def test_every_variable_of_the_environment_is_explained() -> None:
    reported = (DOCS / "reference/environment.md").read_text(encoding="utf-8")
    read = re.compile(r"environ(?:\.get\(|\[)\"(PLANETPOSE_[A-Z_]+)\"|envvar=\"(PLANETPOSE_[A-Z_]+)\"")
    sources = "".join(
        path.read_text(encoding="utf-8") for floor in FLOORS for path in sorted((ROOT / floor).rglob("*.py"))
    )
    used = {name for pair in read.findall(sources) for name in pair if name}
    assert len(used) >= 5
    assert {name for name in used if f"`{name}`" not in reported} == set()


def test_no_page_is_forgotten() -> None:
    """Sphinx tells pages outside every toctree as a warning; this one is for pictures."""
    text = "".join(page.read_text(encoding="utf-8") for page in DOCS.rglob("*.md"))
    assert [picture.name for picture in (DOCS / "_static").glob("*.png") if picture.name not in text] == []


def test_links_of_the_readme_lead_somewhere() -> None:
    links = re.findall(r"\]\((?!https?:|#)([^)#]+)", (ROOT / "README.md").read_text(encoding="utf-8"))
    assert len(links) > 20
    assert [link for link in links if not (ROOT / link).exists()] == []
