"""An archive that misbehaves: what it does with a file is the first part of the path."""

import threading
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

CONTENT = bytes(range(256)) * 800


@dataclass
class Seen:
    """Requests by path, the Range headers that came, and the moments of all requests."""

    requests: Counter[str] = field(default_factory=Counter)
    ranges: list[tuple[str, str]] = field(default_factory=list)
    moments: list[float] = field(default_factory=list)


class Archive(BaseHTTPRequestHandler):
    """A method for each behaviour; `unsaid` gives no length, `elsewhere` a wrong Content-Range."""

    protocol_version = "HTTP/1.1"

    def __init__(self, *arguments: object, seen: Seen) -> None:
        self.seen = seen
        super().__init__(*arguments)  # type: ignore[arg-type]

    def log_message(self, *_: object) -> None:
        """Quiet."""

    def do_GET(self) -> None:
        """Answer as the path says."""
        name = self.path.strip("/").split("/")[-2]
        self.seen.requests[name] += 1
        self.seen.moments.append(time.monotonic())
        if "Range" in self.headers:
            self.seen.ranges.append((name, self.headers["Range"]))
        getattr(self, name.replace("-", "_"))(self.seen.requests[name])

    def status(self, code: int, **headers: str) -> None:
        self.send_response(code)
        for key, value in ({"Content_Length": "0"} | headers).items():
            self.send_header(key.replace("_", "-"), value)
        self.end_headers()

    def send(self, content: bytes = CONTENT, stop_after: int | None = None, tag: str = '"v1"') -> None:
        """The content, or what a Range asks for while the tag is the same; cut off after so many bytes of it."""
        start = 0
        if "Range" in self.headers and self.headers.get("If-Range", tag) == tag:
            start = int(self.headers["Range"].removeprefix("bytes=").rstrip("-"))
            self.send_response(206)
            self.send_header("Content-Range", f"bytes {start}-{len(content) - 1}/{len(content)}")
        else:
            self.send_response(200)
        self.send_header("Content-Length", str(len(content) - start))
        self.send_header("ETag", tag)
        self.end_headers()
        body = content[start:] if stop_after is None else content[start:][:stop_after]
        self.wfile.write(body)
        self.wfile.flush()
        if len(body) < len(content) - start:
            self.close_connection = True

    def good(self, _: int) -> None:
        self.send()

    def twice_503(self, count: int) -> None:
        self.status(503, Retry_After="0") if count <= 2 else self.send()

    def always_503(self, _: int) -> None:
        self.status(503)

    def gone(self, _: int) -> None:
        self.status(404)

    def truncates(self, _: int) -> None:
        self.send(stop_after=0 if "Range" in self.headers else 5000)

    def truncates_once(self, count: int) -> None:
        self.send(stop_after=70_000 if count == 1 else None)

    def stalls_once(self, count: int) -> None:
        if count == 1:
            self.send_response(200)
            self.send_header("Content-Length", str(len(CONTENT)))
            self.send_header("ETag", '"v1"')
            self.end_headers()
            self.wfile.write(CONTENT[:40_000])
            self.wfile.flush()
            time.sleep(1.0)
            self.close_connection = True
        else:
            self.send()

    def wrong_bytes(self, _: int) -> None:
        self.send(b"x" + CONTENT[1:])

    def page(self, _: int) -> None:
        self.send(b"<!DOCTYPE html><html>Not found, but we say 200</html>")

    def endless(self, _: int) -> None:
        self.send_response(200)
        self.send_header("Transfer-Encoding", "chunked")
        self.end_headers()
        for _block in range(400):
            self.wfile.write(b"10000\r\n" + bytes(0x10000) + b"\r\n")

    def chunks_cut(self, _: int) -> None:
        self.send_response(200)
        self.send_header("Transfer-Encoding", "chunked")
        self.end_headers()
        self.wfile.write(b"10000\r\n" + bytes(0x9000))
        self.close_connection = True

    def huge(self, _: int) -> None:
        self.status(200, Content_Length=str(10**12))
        self.close_connection = True

    def unsaid(self, _: int) -> None:
        self.send_response(200)
        self.send_header("Connection", "close")
        self.end_headers()
        self.wfile.write(CONTENT[:1000])
        self.close_connection = True

    def gzip(self, _: int) -> None:
        self.status(200, Content_Encoding="gzip", Content_Length="100")
        self.close_connection = True

    def elsewhere(self, count: int) -> None:
        if count == 1:
            self.send(stop_after=9000)
        elif "Range" in self.headers:
            self.status(206, Content_Range=f"bytes 0-10/{len(CONTENT)}", Content_Length="11")
            self.close_connection = True
        else:
            self.send()

    def changes(self, count: int) -> None:
        self.send(stop_after=9000) if count == 1 else self.send(CONTENT[::-1], tag='"v2"')

    def drops(self, _: int) -> None:
        self.close_connection = True

    def trickles(self, _: int) -> None:
        self.send_response(200)
        self.send_header("Content-Length", str(len(CONTENT)))
        self.end_headers()
        try:
            for _byte in CONTENT[1:]:  # until the client has had enough
                self.wfile.write(b"x")
                self.wfile.flush()
                time.sleep(0.05)
        except OSError:
            pass
        self.close_connection = True


@contextmanager
def running_archive() -> Iterator[tuple[str, Seen]]:
    """Address and record of a running archive."""
    seen = Seen()
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Archive, seen=seen))
    server.daemon_threads = True
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02}, daemon=True)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_port}", seen
    finally:
        server.shutdown()
        server.server_close()
