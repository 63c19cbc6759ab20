"""The pictures of the page in the documentation, made by the page: `python -m building.view_pictures STORE FAILED` in
the folder docs, with Chromium or Chrome.

STORE: a store with the products C0552809300R and lor_0299140073_0x630_sci; FAILED: one with a failed image. The browser
is driven as by the tests.
"""

import sys
import tempfile
from pathlib import Path

COLOURS = 160
SIZE_PX = (1480, 860)
ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "docs" / "_static"


def main() -> None:
    """Write `view.png`, `view-help.png` and `view-failed.png`."""
    sys.path.insert(0, str(ROOT))
    from lab.page.browser import browser_page, find_browser
    from lab.page.drive import View, served

    store, failed = map(Path, sys.argv[1:3])
    with tempfile.TemporaryDirectory() as place, browser_page(str(find_browser()), Path(place)) as page:
        view = View(page)
        with served(store) as url:
            view.open(f"{url}#lor_0299140073_0x630_sci", *SIZE_PX)
            for key in "934":
                view.press(key)
            x, y = view.middle("#picture")
            view.mouse("mouseMoved", x - 60, y - 30)
            view.wait("/phase [0-9]/.test(document.querySelector('#hover').textContent)")
            for kind in ("mouseMoved", "mousePressed", "mouseReleased"):
                view.mouse(kind, x - 61, y - 30)
            view.wait("document.querySelectorAll('#pins tbody tr').length === 1")
            write(view, "view")
            view.open(f"{url}?2#C0552809300R", *SIZE_PX)
            for key in "9h":
                view.press(key)
            view.page.ask("document.getElementById('side').scrollTop = 330")
            x, y = view.middle("#picture")
            view.drag((x, y), (x + 60, y + 45))
            write(view, "view-help")
        with served(failed) as url:
            view.open(url, *SIZE_PX)
            for panel in ("advice", "tried"):
                view.page.ask(f"document.getElementById('{panel}').open = true")
            write(view, "view-failed")


def write(view: "object", name: str) -> None:
    """A picture of the page with few colours, once it is drawn."""
    from PIL import Image

    view.page.ask("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done(true))))")  # type: ignore[attr-defined]
    with tempfile.TemporaryDirectory() as place:
        picture = Image.open(view.picture(Path(place) / "page.png")).convert("RGB")  # type: ignore[attr-defined]
    few = picture.quantize(COLOURS, method=Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
    few.save(FOLDER / f"{name}.png", optimize=True)


if __name__ == "__main__":
    main()
