"""A proxy of the environment never stands between this machine and itself, and one that stands elsewhere is named."""

import json
import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import pytest

from catalog.children import our_command
from catalog.loopback import (
    PROXIES,
    Proxy,
    is_loopback,
    keep_loopback_direct,
    proxy_for,
    set_unusable_proxies_aside,
)
from flows.progress import reporter
from local_server import reachable
from local_server.reachable import ServerError, check_reachable, said_when_it_takes_long
from local_server.server import answers

DEAD = "http://127.0.0.1:9"
SPELLINGS = [spelled for name in PROXIES for spelled in (name, name.upper())]
ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(autouse=True)
def no_proxies(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in (*SPELLINGS, "no_proxy", "NO_PROXY"):
        monkeypatch.delenv(name, raising=False)


class Health(BaseHTTPRequestHandler):
    """A Prefect API, or a proxy that does not get through."""

    status: int = 200

    def do_GET(self) -> None:
        """true, or the status."""
        self.send_response(self.status)
        self.end_headers()
        self.wfile.write(b"true")

    def log_message(self, *_: Any) -> None:
        """Nothing."""


@pytest.fixture
def serving() -> Iterator[Any]:
    """Function that starts a server that answers with a status; its port."""
    servers = []

    def start(status: int) -> int:
        handler = type("Answering", (Health,), {"status": status})
        servers.append(ThreadingHTTPServer(("127.0.0.1", 0), handler))
        threading.Thread(target=servers[-1].serve_forever, daemon=True).start()
        return int(servers[-1].server_port)

    yield start
    for server in servers:
        server.shutdown()
        server.server_close()


@pytest.mark.parametrize(
    "host", ["127.0.0.1", "127.8.9.10", "::1", "[::1]", "localhost", "!10.0.0.1", "!localhost.example.org", "!"]
)
def test_what_is_this_machine(host: str) -> None:
    assert is_loopback(host.strip("!")) is not host.startswith("!")


@pytest.mark.parametrize("variable", SPELLINGS)
@pytest.mark.parametrize("value", [DEAD, "127.0.0.1:9", "socks5://127.0.0.1:9"])
def test_a_server_of_this_machine_is_reached_without_a_proxy(
    serving: Any, monkeypatch: pytest.MonkeyPatch, variable: str, value: str
) -> None:
    monkeypatch.setenv(variable, value)
    url = f"http://127.0.0.1:{serving(200)}/api"
    assert answers(url)
    assert proxy_for(url, os.environ) is None
    check_reachable(url)


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ({}, "localhost,127.0.0.1,::1"),
        ({"no_proxy": "a.org"}, "a.org,localhost,127.0.0.1,::1"),
        ({"NO_PROXY": "a.org, localhost"}, "a.org,localhost,127.0.0.1,::1"),
        ({"no_proxy": "a.org", "NO_PROXY": "b.org"}, "a.org,localhost,127.0.0.1,::1"),
        ({"no_proxy": "*"}, "*"),
        ({"no_proxy": "", "NO_PROXY": "b.org"}, "localhost,127.0.0.1,::1"),
    ],
)
def test_this_machine_joins_the_users_own_exceptions(before: dict[str, str], after: str) -> None:
    for _ in range(2):
        keep_loopback_direct(before)
        assert before == {"no_proxy": after, "NO_PROXY": after}


def test_another_address_of_the_loopback_network_joins_too_and_other_hosts_do_not() -> None:
    environment: dict[str, str] = {}
    keep_loopback_direct(environment, "http://127.0.1.1:4200/api", "https://prefect.example.org/api", "embedded")
    assert environment["no_proxy"] == "localhost,127.0.0.1,::1,127.0.1.1"


CLIENTS = """
import os, sys
from catalog.loopback import keep_loopback_direct, set_unusable_proxies_aside
keep_loopback_direct(os.environ)
print(*(proxy.variable for proxy in set_unusable_proxies_aside(os.environ)))
import httpx, urllib.request
from websockets.proxy import get_proxy
from websockets.uri import parse_uri
for host in ("127.0.0.1", "localhost"):
    url = f"http://{host}:{sys.argv[1]}/api/health"
    print(httpx.get(url).text, urllib.request.urlopen(url).read().decode())
    print(get_proxy(parse_uri(f"ws://{host}:{sys.argv[1]}/api/events/in")))
"""


@pytest.mark.parametrize(
    ("variables", "aside"),
    [
        ({"http_proxy": DEAD, "HTTP_PROXY": DEAD}, ""),
        ({"all_proxy": DEAD, "no_proxy": "a.org"}, ""),
        ({"ALL_PROXY": "socks://127.0.0.1:9", "HTTPS_PROXY": DEAD}, "ALL_PROXY"),
        ({"all_proxy": "socks4://127.0.0.1:9", "HTTP_PROXY": "127.0.0.1:9"}, "all_proxy"),
        ({"http_proxy": "http://[bad", "https_proxy": "ftp://x"}, "https_proxy"),
    ],
)
def test_prefects_clients_reach_this_machine(serving: Any, variables: dict[str, str], aside: str) -> None:
    environment = dict(os.environ)  # without proxies, see above
    command = [sys.executable, "-c", CLIENTS, str(serving(200))]
    done = subprocess.run(
        command, env=environment | variables | {"PYTHONPATH": str(ROOT)}, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == [aside, "true true", "None", "true true", "None"]


def fault_at(url: str, *aside: Proxy) -> str:
    with pytest.raises(ServerError) as failure:
        check_reachable(url, aside, patience_s=0)
    return str(failure.value)


def test_a_server_that_is_not_there_is_named_with_a_remedy() -> None:
    reported = fault_at(f"{DEAD}/api")
    assert "no Prefect server answers at http://127.0.0.1:9/api: [Errno 111] Connection refused" in reported
    assert "--server local or embedded" in reported
    assert "proxy" not in reported


@pytest.mark.parametrize("variable", ["http_proxy", "HTTP_PROXY", "all_proxy", "ALL_PROXY"])
def test_a_proxy_that_is_not_there_is_named_without_its_password(
    monkeypatch: pytest.MonkeyPatch, variable: str
) -> None:
    monkeypatch.setenv(variable, "http://me:secret@127.0.0.1:9")
    if "all" in variable:  # urllib knows none for all schemes; httpx does
        monkeypatch.setattr(reachable, "_fault_of", lambda url: "unreachable")
    reported = fault_at("http://prefect.example.org/api")
    assert f"The request went through {variable}=http://...@127.0.0.1:9" in reported
    assert "no_proxy=prefect.example.org" in reported
    assert "secret" not in reported


@pytest.mark.parametrize("status", [403, 407, 502, 503, 504])
def test_a_proxy_that_does_not_let_us_through_is_named(
    serving: Any, monkeypatch: pytest.MonkeyPatch, status: int
) -> None:
    monkeypatch.setenv("http_proxy", f"http://127.0.0.1:{serving(status)}")
    reported = fault_at("http://prefect.example.org/api")
    assert f"the proxy answers with {status}" in reported
    assert "http_proxy=" in reported


def test_a_proxy_that_prefect_cannot_use_is_named_where_it_matters(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reachable, "_fault_of", lambda url: "Name or service not known")
    environment = {"ALL_PROXY": "socks4://10.0.0.1:1080"}
    aside = set_unusable_proxies_aside(environment)
    assert environment == {}
    assert "ALL_PROXY=socks4://10.0.0.1:1080 is set" in fault_at("http://prefect.example.org/api", *aside)
    assert "ALL_PROXY" not in fault_at("http://127.0.0.1:4200/api", *aside)


@pytest.mark.parametrize(("status", "word"), [(404, "not the API of a Prefect server"), (401, None), (503, None)])
def test_who_says_no_is_there_but_a_page_that_is_not_there_is_no_server(
    serving: Any, status: int, word: str | None
) -> None:
    url = f"http://127.0.0.1:{serving(status)}/api"
    if word is None:
        check_reachable(url, patience_s=0)
    else:
        assert word in fault_at(url)


def test_waiting_is_said_only_when_it_takes_long(capfd: pytest.CaptureFixture[str]) -> None:
    said = threading.Event()
    with said_when_it_takes_long("waiting for nobody", after_s=3600):
        pass
    assert capfd.readouterr().err == ""

    class Heard:
        def write(self, text: str) -> int:
            said.set()
            return len(text)

        def flush(self) -> None:
            """Nothing."""

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "stderr", Heard())
        with said_when_it_takes_long("waiting for nobody", after_s=0):
            assert said.wait(300)


def test_quietly_nothing_is_said_of_what_is_waited_for() -> None:
    before = set(threading.enumerate())  # threads of other tests may take a moment to end

    def speakers() -> list[str]:
        return [thread.name for thread in set(threading.enumerate()) - before]

    with reporter(1, quiet=True), said_when_it_takes_long("waiting for nobody", after_s=3600):
        assert speakers() == []
    with reporter(1, quiet=False), said_when_it_takes_long("waiting for nobody", after_s=3600):
        assert "waiting-said" in speakers()


def test_a_server_that_cannot_be_reached_gives_every_image_a_reason_that_names_it(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(b"no picture")
    command = our_command("correct", "a.png", "--camera", "galileo-ssi")
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PREFECT_")}
    environment |= {"PLANETPOSE_STATE": str(tmp_path / "s"), "PLANETPOSE_CACHE": str(tmp_path / "c")}
    environment |= {"PYTHONPATH": str(ROOT), "PLANETPOSE_KERNELS": "", "http_proxy": DEAD}
    done = subprocess.run(
        [*command, "--server", "http://prefect.invalid/api", "--json", "--store", "out"],
        cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=300,
    )  # fmt: skip
    assert done.returncode == 1
    result = json.loads(done.stdout)
    assert result["status"] == "failed"
    assert result["reason"].startswith("prefect: no Prefect server answers at http://prefect.invalid/api: ")
    assert "http_proxy=http://127.0.0.1:9" in result["reason"]
