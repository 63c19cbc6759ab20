"""Who may use the page: this machine's own browser; others with a token. Nothing is answered to other sites' pages.

A page elsewhere in the same browser can send requests to this server: it would come with another Origin, or by a name
that a foreign name server made point here (DNS rebinding). So the Host must be one of ours, and whatever changes
something must come from our own page (Origin, Sec-Fetch-Site) and bring the token that only our own page has.
"""

import secrets
from collections.abc import Awaitable, Callable, MutableMapping
from dataclasses import dataclass, field
from http.cookies import SimpleCookie
from typing import Any
from urllib.parse import parse_qs

Scope = MutableMapping[str, Any]
Message = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Message]]
Send = Callable[[Message], Awaitable[None]]
App = Callable[[Scope, Receive, Send], Awaitable[None]]

LOCAL = ("localhost", "127.0.0.1", "::1")
TOKEN_HEADER = "x-planetpose-token"
COOKIE = "planetpose-token"
SAME_SITE = ("same-origin", "none", "")
READING = ("GET", "HEAD")
LARGEST_BODY = 32_000_000  # a mask of a large detector, as PNG
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'"
)
UNFRAMED = "; frame-ancestors 'none'"


@dataclass(frozen=True)
class Access:
    """host, port: where the server listens. token: needed to change something, and for everything unless `is_local`.
    read_only: nothing can be changed. names: further host names that the server is reached by. framed: the page may be
    shown within another one, a notebook's, by its address with the token."""

    host: str = "127.0.0.1"
    port: int = 0
    read_only: bool = False
    names: tuple[str, ...] = ()
    framed: bool = False
    token: str = field(default_factory=lambda: secrets.token_urlsafe(24), repr=False)

    @property
    def is_local(self) -> bool:
        """Whether only this machine can reach the server."""
        return self.host in LOCAL

    def url(self) -> str:
        """The page's address, with the token where it is needed."""
        name = f"[{self.host}]" if ":" in self.host else self.host
        return f"http://{name}:{self.port}/" + ("" if self.is_local and not self.framed else f"?token={self.token}")

    def knows(self, host: str) -> bool:
        """Whether a request's Host header names this server."""
        name, port = split_host(host)
        if port not in (str(self.port), "") and self.port:
            return False
        known = {*self.names, *LOCAL, self.host}
        # Listening on all addresses, it may be reached by any; the token protects it then.
        return name in known or (self.host in ("0.0.0.0", "::") and is_address(name))


def split_host(host: str) -> tuple[str, str]:
    """(name, port) of a Host header."""
    if host.startswith("["):
        name, _, rest = host[1:].partition("]")
        return name, rest.removeprefix(":")
    name, _, port = host.partition(":")
    return name.lower(), port


def is_address(name: str) -> bool:
    """Whether a name is an IP address, which no name server can make point elsewhere."""
    from ipaddress import ip_address

    try:
        ip_address(name)
    except ValueError:
        return False
    return True


class Guard:
    """ASGI middleware: refuses what `Access` does not allow, and sets the headers that keep the page to itself."""

    def __init__(self, app: App, access: Access) -> None:
        self.app, self.access = app, access

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on or refuse."""
        if scope["type"] != "http":
            if scope["type"] == "lifespan":
                await self.app(scope, receive, send)
            return
        headers = {key.decode("latin-1").lower(): value.decode("latin-1") for key, value in scope["headers"]}
        fault = self.fault_of(scope["method"], headers, scope.get("query_string", b"").decode("latin-1"))
        if fault:
            await refuse(send, *fault)
            return
        await self.app(scope, receive, self.with_headers(send, scope))

    def fault_of(self, method: str, headers: dict[str, str], query: str) -> tuple[int, str] | None:
        """Status and text of a refusal; None for a request that is allowed."""
        access = self.access
        if not access.knows(headers.get("host", "")):
            return 421, "This server has another name."
        origin = headers.get("origin")
        if origin not in (None, "null") and not access.knows(origin.partition("://")[2] if origin else ""):
            return 403, "Requests of other sites are refused."
        if headers.get("sec-fetch-site", "") not in SAME_SITE and not self.is_a_visit(method, headers, query):
            return 403, "Requests of other sites are refused."
        given = [headers.get(TOKEN_HEADER), cookie_of(headers), *parse_qs(query).get("token", [])]
        if not access.is_local and not any(self.is_token(each) for each in given):
            return 401, "Open the page with its token: the address that planetpose view printed."
        if method in READING:
            return None
        if access.read_only:
            return 403, "This page only shows."
        if origin == "null" or not self.is_token(headers.get(TOKEN_HEADER)):
            return 403, "Only the page itself may change something."
        length = headers.get("content-length", "")
        if not length.isdigit() or int(length) > LARGEST_BODY:
            return 413, "Too much at once."
        return None

    def is_a_visit(self, method: str, headers: dict[str, str], query: str) -> bool:
        """Whether somebody follows a link to the page from another site, or a notebook shows it in a frame by its
        token: that shows the page and gives nothing away."""
        places = ("document", "iframe") if self.may_be_framed(query) else ("document",)
        navigates = method == "GET" and headers.get("sec-fetch-mode") == "navigate"
        return navigates and headers.get("sec-fetch-dest") in places

    def may_be_framed(self, query: str) -> bool:
        """Whether a request may come from within another page."""
        return self.access.framed and any(self.is_token(each) for each in parse_qs(query).get("token", []))

    def is_token(self, given: str | None) -> bool:
        """Whether it is ours; the comparison takes the same time for every text."""
        return given is not None and secrets.compare_digest(given.encode(), self.access.token.encode())

    def with_headers(self, send: Send, scope: Scope) -> Send:
        """`send` that adds the headers."""
        query = scope.get("query_string", b"").decode("latin-1")
        more = [
            (b"content-security-policy", (POLICY + ("" if self.may_be_framed(query) else UNFRAMED)).encode()),
            (b"x-content-type-options", b"nosniff"),
            (b"referrer-policy", b"no-referrer"),
            (b"cross-origin-resource-policy", b"same-origin"),
        ]
        given = parse_qs(query).get("token", [])
        if any(self.is_token(each) for each in given):
            cookie = f"{COOKIE}={self.access.token}; HttpOnly; SameSite=Strict; Path=/"
            more.append((b"set-cookie", cookie.encode()))

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [*message.get("headers", []), *more]
            await send(message)

        return send_with_headers


def cookie_of(headers: dict[str, str]) -> str | None:
    """The token in a request's cookie."""
    found = SimpleCookie(headers.get("cookie", "")).get(COOKIE)
    return found.value if found else None


async def refuse(send: Send, status: int, text: str) -> None:
    """Answer with a refusal."""
    body = text.encode()
    headers = [(b"content-type", b"text/plain; charset=utf-8"), (b"content-length", str(len(body)).encode())]
    await send({"type": "http.response.start", "status": status, "headers": headers})
    await send({"type": "http.response.body", "body": body})
