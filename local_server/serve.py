"""A Prefect server in the foreground, for systemd, a container, or a terminal.

It listens on this machine's own address unless another is given, and then only behind authentication. Database and
secrets come from the environment, as Prefect documents it.
"""

import os
import sys
from collections.abc import Mapping

from catalog.children import their_module
from catalog.errors import RefusedError
from catalog.loopback import is_loopback, keep_loopback_direct

AUTHENTICATION = "PREFECT_SERVER_API_AUTH_STRING"
CLIENT_AUTHENTICATION = "PREFECT_API_AUTH_STRING"
SHORTEST_PASSWORD = 12
EVERY_ADDRESS = ("0.0.0.0", "::", "")  # no address that a browser could use
PRIVATE = {
    "PREFECT_SERVER_ANALYTICS_ENABLED": "false",
    "DO_NOT_TRACK": "1",
    "PREFECT_SERVER_UI_SHOW_PROMOTIONAL_CONTENT": "false",
    # The newer pages ask an analytics host for its configuration, whatever PREFECT_SERVER_ANALYTICS_ENABLED says.
    "PREFECT_SERVER_UI_V2_ENABLED": "false",
    # Runs that ended a month ago, and their events: otherwise the database grows for ever.
    "PREFECT_SERVER_SERVICES_DB_VACUUM_ENABLED": "events,flow_runs",
    "PREFECT_SERVER_SERVICES_DB_VACUUM_RETENTION_PERIOD": str(30 * 24 * 3600),
}


def check_door(host: str, environment: Mapping[str, str]) -> None:
    """Raises RefusedError when other machines could reach a server at `host` without a password worth the name: who
    reaches a Prefect server can run any program on its workers."""
    if is_loopback(host):
        return
    _, colon, password = environment.get(AUTHENTICATION, "").partition(":")
    if not colon or len(password) < SHORTEST_PASSWORD:
        raise RefusedError(
            "server-without-authentication",
            f"other machines can reach {host}, and {AUTHENTICATION} is not USER:PASSWORD with a password of at least "
            f"{SHORTEST_PASSWORD} characters.",
            f"Set it, and {CLIENT_AUTHENTICATION} to the same for workers and commands; or use --host 127.0.0.1.",
        )


def serving_environment(host: str, port: int, environment: Mapping[str, str]) -> dict[str, str]:
    """Environment of a server at host and port. Web pages of other origins may not call it (Prefect's default lets
    any page that somebody on this machine opens do so)."""
    shown = f"[{host}]" if ":" in host else host
    origins = f"http://{shown}:{port},http://localhost:{port}" if is_loopback(host) else f"http://{shown}:{port}"
    # The page's own server: by default the page talks, and sends its password, to port 4200 whatever the port is.
    api = "/api" if host in EVERY_ADDRESS else f"http://{shown}:{port}/api"
    own = {"PREFECT_SERVER_CORS_ALLOWED_ORIGINS": origins, "PREFECT_SERVER_UI_API_URL": api}
    served = {**own, **PRIVATE, **environment}
    served.pop("PREFECT_API_URL", None)  # it is for clients; a server that finds it may take itself for one
    keep_loopback_direct(served)
    return served


def serve(host: str, port: int) -> None:
    """Become a Prefect server; does not return. Raises RefusedError as `check_door`."""
    check_door(host, os.environ)
    command = their_module("prefect", "server", "start", "--host", host, "--port", str(port))
    os.execve(sys.executable, command, serving_environment(host, port, os.environ))
