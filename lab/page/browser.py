"""A headless Chromium, spoken to over its own protocol: enough to load a page and ask what is wrong with it."""

import json
import shutil
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from websockets.sync.client import connect
from websockets.sync.connection import Connection

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome", "chromium-headless-shell")
START_S, ANSWER_S = 300.0, 120.0


def find_browser() -> str | None:
    """Path of an installed Chromium or Chrome."""
    return next((path for name in NAMES if (path := shutil.which(name))), None)


class BrowserError(Exception):
    """What the browser, or a script in its page, complained about."""


class Page:
    """One page. complaints: errors and warnings of its console, exceptions, files that did not load."""

    def __init__(self, socket: Connection) -> None:
        self._socket, self._number = socket, 0
        self.complaints: list[str] = []
        for domain in ("Page", "Runtime", "Log", "Network"):
            self._ask(f"{domain}.enable")

    def open(self, url: str, width: int = 1400, height: int = 900) -> None:
        """Load `url` in a window of this size and wait for it."""
        self.complaints.clear()
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self._ask("Emulation.setDeviceMetricsOverride", **size)
        self._ask("Page.navigate", url=url)
        deadline = time.monotonic() + ANSWER_S
        while self._take(deadline).get("method") != "Page.loadEventFired":
            pass

    def ask(self, expression: str) -> Any:
        """The value of a JavaScript expression, of its promise if it is one. Raises BrowserError when it throws."""
        answer = self._ask("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in answer:
            raise BrowserError(answer["exceptionDetails"])
        return answer["result"].get("value")

    def _ask(self, method: str, **parameters: Any) -> dict[str, Any]:
        self._number += 1
        self._socket.send(json.dumps({"id": self._number, "method": method, "params": parameters}))
        deadline = time.monotonic() + ANSWER_S
        while True:
            message = self._take(deadline)
            if message.get("id") == self._number:
                if "error" in message:
                    raise BrowserError(message["error"])
                return message["result"]

    def _take(self, deadline: float) -> dict[str, Any]:
        message = json.loads(self._socket.recv(timeout=max(deadline - time.monotonic(), 0.1)))
        reported = message.get("params", {})
        match message.get("method"):
            case "Runtime.exceptionThrown":
                self.complaints.append(str(reported["exceptionDetails"]))
            case "Runtime.consoleAPICalled" if reported["type"] in ("error", "warning", "assert"):
                self.complaints.append(str(reported["args"]))
            case "Log.entryAdded" if reported["entry"]["level"] in ("error", "warning"):
                self.complaints.append(reported["entry"]["text"])
            case "Network.loadingFailed" if not reported.get("canceled"):
                self.complaints.append(reported["errorText"])
        return message


@contextmanager
def browser_page(program: str, profile: Path) -> Iterator[Page]:
    """A page of a new browser, whose own files are in the folder `profile`."""
    options = ("--headless=new", "--no-sandbox", "--disable-gpu", "--no-first-run", "--remote-debugging-port=0")
    process = subprocess.Popen(
        [program, *options, f"--user-data-dir={profile}", "about:blank"],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        port = _port(profile / "DevToolsActivePort")
        with connect(_page_address(port), max_size=None, proxy=None) as socket:
            yield Page(socket)
    finally:
        process.terminate()
        process.wait(120)


def _port(file: Path) -> int:
    deadline = time.monotonic() + START_S
    while time.monotonic() < deadline:
        if file.is_file() and (lines := file.read_text().split()):
            return int(lines[0])
        time.sleep(0.05)
    raise TimeoutError("the browser did not start")


def _page_address(port: int) -> str:
    from urllib.request import ProxyHandler, build_opener

    with build_opener(ProxyHandler({})).open(f"http://127.0.0.1:{port}/json/list", timeout=ANSWER_S) as answer:
        pages = [entry for entry in json.load(answer) if entry["type"] == "page"]
    return str(pages[0]["webSocketDebuggerUrl"])
