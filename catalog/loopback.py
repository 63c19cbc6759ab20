"""Addresses of this machine are reached directly, whatever proxy the environment names.

An institute's proxy does not reach the loopback network of its users' machines. urllib, httpx (Prefect's client) and
websockets all take proxies from the environment, and leave alone the hosts that `no_proxy` names.
"""

import ipaddress
from collections.abc import Mapping, MutableMapping
from dataclasses import dataclass
from urllib.parse import urlsplit
from urllib.request import ProxyHandler, build_opener, proxy_bypass

LOOPBACK = ("localhost", "127.0.0.1", "::1")
PROXIES = ("http_proxy", "https_proxy", "all_proxy")
NO_PROXY = ("no_proxy", "NO_PROXY")


def is_loopback(host: str) -> bool:
    """Whether only this machine can reach `host`: an address of its loopback network, or `localhost`."""
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return host == "localhost"


def host_of(url: str) -> str:
    """Host of a URL, "" where it has none."""
    try:
        return urlsplit(url).hostname or ""
    except ValueError:
        return ""


def keep_loopback_direct(environment: MutableMapping[str, str], *urls: str) -> None:
    """Add this machine's own addresses, and those of `urls` that are such, to the hosts that no proxy is used for.

    Both spellings of the variable are set: programs differ in which of them they read. The user's own hosts stay.
    """
    own = [*LOOPBACK, *(host for host in map(host_of, urls) if host not in LOOPBACK and is_loopback(host))]
    lower, upper = NO_PROXY
    # As in Python: the lower-case variable is the one that counts when both are there.
    known = [part.strip() for part in environment.get(lower, environment.get(upper, "")).split(",") if part.strip()]
    if "*" not in known:
        known += [host for host in own if host not in known]
    environment[lower] = environment[upper] = ",".join(known)


@dataclass(frozen=True)
class Proxy:
    """variable: as the user wrote it; url: its value."""

    variable: str
    url: str

    def __str__(self) -> str:
        """Without what may be a password."""
        before, at, after = self.url.rpartition("@")
        scheme, slashes, _ = before.partition("://")
        return f"{self.variable}={scheme + slashes if slashes else ''}{'...@' if at else ''}{after}"


def proxy_for(url: str, environment: Mapping[str, str]) -> Proxy | None:
    """The proxy that a request to `url` would go through; None when it goes there directly."""
    host = host_of(url)
    if is_loopback(host) or proxy_bypass(host):
        return None
    for name in (f"{urlsplit(url).scheme}_proxy", "all_proxy"):
        for variable in (name, name.upper()):
            if environment.get(variable):
                return Proxy(variable, environment[variable])
    return None


def set_unusable_proxies_aside(environment: MutableMapping[str, str]) -> list[Proxy]:
    """Remove proxies that httpx cannot use (socks without `socksio`, schemes that it does not know): it would fail on
    them even for hosts that need none. Returns what was removed."""
    aside = []
    for variable in (spelled for name in PROXIES for spelled in (name, name.upper())):
        value = environment.get(variable)
        if value and not _is_usable(value):
            aside.append(Proxy(variable, value))
            del environment[variable]
    return aside


def _is_usable(value: str) -> bool:
    import httpx

    try:
        httpx.HTTPTransport(proxy=httpx.Proxy(value if "://" in value else f"http://{value}")).close()
    except (ValueError, ImportError, httpx.InvalidURL):
        return False
    return True


def open_url(url: str, timeout_s: float):  # type: ignore[no-untyped-def]
    """`urllib.request.urlopen`, without a proxy where `url` is this machine's own."""
    direct = [ProxyHandler({})] if is_loopback(host_of(url)) else []
    return build_opener(*direct).open(url, timeout=timeout_s)


def is_address(text: str) -> bool:
    """Whether a text has the form of an API's URL."""
    try:
        parts = urlsplit(text)
        return parts.scheme in ("http", "https") and bool(parts.hostname)
    except ValueError:
        return False
