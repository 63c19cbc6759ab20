"""An S3 server (moto) as a process of its own, behind a relay that can be cut, and counts of its requests."""

import asyncio
import os
import re
import threading
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from catalog.children import their_module
from lab.rehearsal.processes import Session, wait_until
from local_server.server import free_port

BUCKET = "planetpose"
REQUEST = re.compile(r'\[\S+ (\S+)\] "(?:\x1b\S*m)?(GET|PUT|HEAD|DELETE|POST) (/\S*) HTTP/1\.1(?:\x1b\S*m)?" (\d{3})')


@dataclass
class Requests:
    """The requests of an S3 server. kinds: by method, and `LIST` for listings. records: how often the record of each
    product was written, which is what says that it is whole. writes: of them, in words."""

    kinds: Counter[str] = field(default_factory=Counter)
    places: Counter[str] = field(default_factory=Counter)
    records: Counter[str] = field(default_factory=Counter)
    writes: list[str] = field(default_factory=list)

    def to_dict(self) -> dict[str, int]:
        """Counts by kind."""
        return dict(sorted(self.kinds.items()))


class S3Server:
    """The server. endpoint: of the relay before it."""

    def __init__(self, folder: Path) -> None:
        self._port, self._log = free_port(), folder / "s3.log"
        command = their_module("moto.server", "-H", "127.0.0.1", "-p", str(self._port))
        self.session = Session(command, os.environ, self._log, folder)
        self.relay = Relay(self._port)
        self.endpoint = f"http://127.0.0.1:{self.relay.port}"
        self.environment = {
            "AWS_ENDPOINT_URL": self.endpoint,
            "AWS_ACCESS_KEY_ID": "scale",
            "AWS_SECRET_ACCESS_KEY": "scale",
            "AWS_DEFAULT_REGION": "us-east-1",
        }
        self._read = 0

    def start(self) -> Any:
        """Wait until it answers; fsspec's file system of its bucket."""
        import fsspec

        os.environ.update(self.environment)
        files = fsspec.filesystem("s3", use_listings_cache=False, skip_instance_cache=True)

        def is_up() -> bool:
            with suppress(OSError):
                files.mkdir(BUCKET)
                return True
            return False

        wait_until("the S3 server", is_up, 60)
        return files

    def requests(self) -> Requests:
        """The requests since the last look."""
        found = Requests()
        with self._log.open("rb") as log:
            log.seek(self._read)
            content = log.read()
            self._read += len(content)
        for at, method, target, status in REQUEST.findall(content.decode("utf-8", "replace")):
            path, _, query = target.partition("?")
            found.kinds["LIST" if "list-type=2" in query else method] += 1
            found.places[f"{'LIST' if 'list-type=2' in query else method} {place_in(path, query)}"] += 1
            if path.endswith("/record.json") and method in ("PUT", "DELETE"):
                product = path.split("/")[-2]
                found.records[product] += method == "PUT" and status == "200"
                found.writes.append(f"{at} {method} {product} {status}")
        return found

    def end(self) -> None:
        """End server and relay."""
        self.relay.end()
        self.session.end()


def place_in(path: str, query: str) -> str:
    """What kind of object a request is for."""
    text = f"{path}?{query}"
    for part in ("images", "traces", "runs", "leases"):
        if f".reprocess/{part}" in text.replace("%2F", "/"):
            return part
    for part in ("/cache/", "/store/", "/list/"):
        if part in text.replace("%2F", "/"):
            return part.strip("/")
    return "other"


class Relay:
    """Passes connections on to a port of this machine, or cuts them."""

    def __init__(self, port: int) -> None:
        self.port, self._to, self._is_cut = free_port(), port, False
        self.bytes = 0
        self._writers: set[asyncio.StreamWriter] = set()
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    @contextmanager
    def cut(self) -> Iterator[None]:
        """Within the `with` block every connection breaks, those under way too."""
        self._is_cut = True
        self._loop.call_soon_threadsafe(self._drop)
        try:
            yield
        finally:
            self._is_cut = False

    def end(self) -> None:
        """Serve no more."""
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(5)

    def _serve(self) -> None:
        asyncio.set_event_loop(self._loop)
        self._loop.run_until_complete(asyncio.start_server(self._pass_on, "127.0.0.1", self.port))
        self._loop.run_forever()

    def _drop(self) -> None:
        for writer in list(self._writers):
            writer.transport.abort()

    async def _pass_on(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if self._is_cut:
            writer.transport.abort()
            return
        there_reader, there_writer = await asyncio.open_connection("127.0.0.1", self._to)
        self._writers |= {writer, there_writer}
        try:
            await asyncio.gather(self._copy(reader, there_writer), self._copy(there_reader, writer))
        finally:
            self._writers -= {writer, there_writer}

    async def _copy(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with suppress(OSError):
            while block := await reader.read(1 << 16):
                self.bytes += len(block)
                writer.write(block)
                await writer.drain()
            writer.close()
