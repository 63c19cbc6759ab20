"""Whether a Prefect server answers, found out in seconds; and a word to the user while one is waited for."""

import os
import socket
import sys
import threading
import time
import urllib.error
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from urllib.parse import urlsplit

from catalog.loopback import Proxy, host_of, is_loopback, open_url, proxy_for

ATTEMPT_TIMEOUT_S = 3.0
PATIENCE_S = 6.0
PAUSE_S = 0.5
SAY_AFTER_S, SAY_EVERY_S = 3.0, 10.0
# What a proxy answers when it does not get through to the server, or does not let us.
FROM_THE_PROXY = (403, 407, 502, 503, 504)


class ServerError(Exception):
    """A Prefect server cannot be started or reached."""


class Silence:
    """How long a server has taken connections at its address without answering. Prefect's listens when it is ready to
    answer, so that such a silence does not end."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._since: float | None = None

    def seconds(self, url: str | None) -> float:
        """Seconds since it was first seen to listen, 0 while it does not."""
        if url is None or not listens(url):
            self._since = None
            return 0.0
        self._since = self._clock() if self._since is None else self._since
        return self._clock() - self._since


def listens(url: str) -> bool:
    """Whether something takes connections at the host and port of a URL."""
    parts = urlsplit(url)
    try:
        with socket.create_connection((parts.hostname or "", parts.port or 80), ATTEMPT_TIMEOUT_S):
            return True
    except OSError:
        return False


def check_reachable(url: str, aside: Sequence[Proxy] = (), patience_s: float = PATIENCE_S) -> None:
    """Raises ServerError that names the URL, the proxy on the way and a remedy, when no Prefect API answers there.

    A server that restarts is given `patience_s`. aside: proxies that are set and that Prefect's client cannot use.
    """
    deadline = time.monotonic() + patience_s
    while True:
        fault = _fault_of(url)
        if fault is None:
            return
        if time.monotonic() + PAUSE_S > deadline:
            raise ServerError(f"no Prefect server answers at {url}: {fault}. {_remedy(url, aside)}")
        time.sleep(PAUSE_S)


def _fault_of(url: str) -> str | None:
    try:
        with open_url(f"{url.rstrip('/')}/health", ATTEMPT_TIMEOUT_S):
            return None
    except urllib.error.HTTPError as error:
        if error.code == 404:
            return "what answers there has no /health, so it is not the API of a Prefect server"
        if error.code in FROM_THE_PROXY and proxy_for(url, os.environ):
            return f"the proxy answers with {error.code} {error.reason}"
        return None  # it answers, if only to say no
    except (OSError, ValueError) as error:
        return str(getattr(error, "reason", error)) or type(error).__name__


def _remedy(url: str, aside: Sequence[Proxy]) -> str:
    host, proxy = host_of(url), proxy_for(url, os.environ)
    if proxy is None and aside and not is_loopback(host):
        return (
            f"{aside[0]} is set, which Prefect's client cannot use (socks5:// needs pip install socksio). "
            f"Set no_proxy={host} if the server needs no proxy, or use --server local or embedded."
        )
    if proxy is not None:
        return (
            f"The request went through {proxy}. "
            f"Set no_proxy={host} if the server needs no proxy, or use --server local or embedded."
        )
    return "Check --server or PREFECT_API_URL (it ends in /api), or use --server local or embedded."


_quiet: ContextVar[bool] = ContextVar("quiet", default=False)


@contextmanager
def quietly() -> Iterator[None]:
    """Within the `with` block nothing is said of what is waited for."""
    token = _quiet.set(True)
    try:
        yield
    finally:
        _quiet.reset(token)


@contextmanager
def said_when_it_takes_long(
    text: str | Callable[[], str], after_s: float = SAY_AFTER_S, every_s: float = SAY_EVERY_S
) -> Iterator[None]:
    """Tell the user on stderr what is waited for, and for how long by now, when the `with` block takes longer than a
    few seconds, and again every so many; nothing `quietly`. text: what is waited for; a function where that changes."""
    if _quiet.get():
        yield
        return
    over, began = threading.Event(), time.monotonic()

    def say() -> None:
        pause = after_s
        while not over.wait(pause):
            what = text if isinstance(text, str) else text()
            print(f"planetpose: {what} ({time.monotonic() - began:.0f} s by now)", file=sys.stderr, flush=True)
            pause = every_s

    thread = threading.Thread(target=say, daemon=True, name="waiting-said")
    thread.start()
    try:
        yield
    finally:
        over.set()
