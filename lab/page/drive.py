"""The page in a headless browser, driven as a person would: mouse, keys, typing; and its server."""

import base64
import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from lab.page.browser import Page

ANSWER_S = 60.0  # on a busy machine; less than the browser itself is given


class View:
    """A page of the viewer in a browser."""

    def __init__(self, page: Page) -> None:
        self.page = page

    def open(self, url: str, width: int = 1280, height: int = 800) -> float:
        """Load it and wait for the first picture; seconds that took."""
        started = time.monotonic()
        self.page.open(url, width, height)
        self.wait("window.planetposeTimes?.opened.length > 0 || !document.getElementById('fault').hidden")
        return time.monotonic() - started

    def wait(self, condition: str, seconds: float = ANSWER_S) -> None:
        """Until a JavaScript condition is true."""
        code = f"""new Promise((resolve, reject) => {{
            const late = setTimeout(() => reject(new Error("waited in vain")), {seconds * 1000});
            const look = () => {{
                if ({condition}) {{ clearTimeout(late); resolve(true); }} else setTimeout(look, 5);
            }};
            look();
        }})"""
        self.page.ask(code)

    def press(self, key: str, **more: Any) -> None:
        """A key of the keyboard."""
        text = {"text": key} if len(key) == 1 else {}
        for kind in ("keyDown", "keyUp"):
            self.page._ask("Input.dispatchKeyEvent", type=kind, key=key, **(text if kind == "keyDown" else {}), **more)

    def type(self, selector: str, text: str) -> None:
        """Text into a field."""
        self.page.ask(f"document.querySelector({json.dumps(selector)}).focus()")
        self.page.ask(f"document.querySelector({json.dumps(selector)}).select?.()")
        self.page._ask("Input.insertText", text=text)

    def click(self, selector: str) -> None:
        """The middle of an element."""
        self.mouse("mousePressed", *self.middle(selector))
        self.mouse("mouseReleased", *self.middle(selector))

    def middle(self, selector: str) -> tuple[float, float]:
        """Where an element's middle is, after it was brought into sight."""
        code = f"""(() => {{
            const element = document.querySelector({json.dumps(selector)});
            element.scrollIntoView({{block: "nearest"}});
            const box = element.getBoundingClientRect();
            return [box.x + box.width / 2, box.y + box.height / 2];
        }})()"""
        found = self.page.ask(code)
        return found[0], found[1]

    def mouse(self, kind: str, x: float, y: float) -> None:
        """A mouse event."""
        button = "none" if kind == "mouseMoved" else "left"
        self.page._ask("Input.dispatchMouseEvent", type=kind, x=x, y=y, button=button, buttons=1, clickCount=1)

    def drag(self, start: tuple[float, float], end: tuple[float, float], steps: int = 8) -> None:
        """From one place to another, button down."""
        self.mouse("mouseMoved", *start)
        self.mouse("mousePressed", *start)
        for step in range(1, steps + 1):
            self.mouse("mouseMoved", *(a + (b - a) * step / steps for a, b in zip(start, end, strict=True)))
        self.mouse("mouseReleased", *end)

    def text(self, selector: str) -> str:
        """What an element says."""
        return str(self.page.ask(f"document.querySelector({json.dumps(selector)}).textContent"))

    def picture(self, path: Path) -> Path:
        """A picture of the page."""
        content = self.page._ask("Page.captureScreenshot", format="png")["data"]
        path.write_bytes(base64.b64decode(content))
        return path


@contextmanager
def served(store: Path, *options: str, program: str = "", index: str = "") -> Iterator[str]:
    """The server of `planetpose view` in a process of its own, and the page's address. program: in place of the
    command, a script that gets the store and an index."""
    import planetpose_launcher

    launcher = str(Path(planetpose_launcher.__file__))
    words = [program, str(store), index] if program else ["-P", launcher, "view", str(store), "--no-open", *options]
    environment = {**os.environ, "PYTHONPATH": str(Path(launcher).parent)} if program else None
    process = subprocess.Popen([sys.executable, *words], stdout=subprocess.PIPE, text=True, env=environment)
    try:
        line = process.stdout.readline() if process.stdout else ""
        yield line.split()[2]
    finally:
        process.terminate()
        process.wait(60)
