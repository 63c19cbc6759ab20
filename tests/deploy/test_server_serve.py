"""A server opens to other machines only behind a password."""

import os
import subprocess
import sys

import pytest

from catalog.errors import RefusedError
from local_server.serve import AUTHENTICATION, check_door, is_loopback, serving_environment


@pytest.mark.parametrize("host", ["127.0.0.1", "127.9.9.9", "localhost", "::1", "[::1]"])
def test_this_machines_own_addresses_need_no_password(host: str) -> None:
    assert is_loopback(host)
    check_door(host, {})


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.168.1.7", "server.example.org", "localhost.example.org", ""])
@pytest.mark.parametrize("credentials", [None, "", "admin", "admin:", "admin:pass", "a-long-word-without-a-colon"])
def test_other_addresses_are_refused_without_a_password_worth_the_name(host: str, credentials: str | None) -> None:
    environment = {} if credentials is None else {AUTHENTICATION: credentials}
    with pytest.raises(RefusedError, match=AUTHENTICATION) as refused:
        check_door(host, environment)
    assert refused.value.code == "server-without-authentication"
    assert credentials is None or len(credentials) < 12 or credentials not in str(refused.value)


def test_with_a_password_any_address_is_served() -> None:
    check_door("0.0.0.0", {AUTHENTICATION: "admin:twelve-or-more"})


def test_the_command_ends_with_the_reason_and_starts_nothing() -> None:
    command = [sys.executable, "-c", "from flows.cli import main; main()", "server", "serve", "--host", "0.0.0.0"]
    done = subprocess.run(command, env={"PATH": ""}, capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 1
    assert "server-without-authentication" in done.stderr
    assert "--host 127.0.0.1" in done.stderr


def test_pages_of_other_origins_may_not_call_the_server_and_nothing_is_sent_anywhere() -> None:
    served = serving_environment("127.0.0.1", 4200, {"PREFECT_API_URL": "http://elsewhere/api", "KEPT": "1"})
    assert served["PREFECT_SERVER_CORS_ALLOWED_ORIGINS"] == "http://127.0.0.1:4200,http://localhost:4200"
    assert served["PREFECT_SERVER_ANALYTICS_ENABLED"] == "false"
    assert served["KEPT"] == "1"
    assert "PREFECT_API_URL" not in served


def test_what_the_environment_sets_stays() -> None:
    chosen = {"PREFECT_SERVER_CORS_ALLOWED_ORIGINS": "https://prefect.example.org"}
    assert serving_environment("0.0.0.0", 80, chosen)["PREFECT_SERVER_CORS_ALLOWED_ORIGINS"] == (
        "https://prefect.example.org"
    )


@pytest.mark.parametrize(
    ("host", "port", "reported"),
    [("127.0.0.1", 4321, "http://127.0.0.1:4321/api"), ("::1", 80, "http://[::1]:80/api"), ("0.0.0.0", 4321, "/api")],
)
def test_the_page_talks_to_the_port_that_it_came_from(host: str, port: int, reported: str) -> None:
    """As Prefect itself reads the environment of the server."""
    script = "from prefect.settings import get_current_settings as s; print(s().server.ui.api_url)"
    environment = serving_environment(host, port, dict(os.environ))
    command = [sys.executable, "-c", script]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True, timeout=300)
    assert done.stdout.strip() == reported
