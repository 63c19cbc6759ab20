"""Prefect's settings for the command line: the user's own Prefect stays as it is, and stdout stays ours."""

import os
import secrets
import sys
import urllib.error
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

from catalog.loopback import keep_loopback_direct, open_url, set_unusable_proxies_aside
from local_server.reachable import check_reachable, said_when_it_takes_long
from local_server.serve import AUTHENTICATION, CLIENT_AUTHENTICATION
from local_server.server import HEALTH_TIMEOUT_S, ensure_server, server_files

QUIET = {
    "PREFECT_SERVER_ANALYTICS_ENABLED": "false",
    "DO_NOT_TRACK": "1",
    "PREFECT_LOGGING_EXTRA_LOGGERS": "planetpose",
    "PREFECT_LOGGING_TO_API_WHEN_MISSING_FLOW": "ignore",
    "PREFECT_LOGGING_HANDLERS_CONSOLE_LEVEL": "CRITICAL",  # reasons are given once, in the result
    "PREFECT_INTERNAL_LOGGING_LEVEL": "CRITICAL",
    "PREFECT_CLIENT_MAX_RETRIES": "3",
    "PREFECT_SERVER_EPHEMERAL_STARTUP_TIMEOUT_SECONDS": "180",
}
EMBEDDED, LOCAL = "embedded", "local"


def server_choice(option: str | None) -> str:
    """Which server to use: the option, else PREFECT_API_URL, else PLANETPOSE_SERVER, else `local`."""
    return option or os.environ.get("PREFECT_API_URL") or os.environ.get("PLANETPOSE_SERVER") or LOCAL


def prepare(choice: str) -> None:
    """Set the environment that Prefect reads when it is imported. `choice`: local (started if need be), embedded (a
    server within this command, slow), or the URL of an API. Raises ServerError when the local one does not start, or
    none answers at the URL."""
    os.environ["PYTHONSAFEPATH"] = "1"  # what Prefect starts by `python -m` does not look in the working folder
    keep_loopback_direct(os.environ, choice)
    aside = set_unusable_proxies_aside(os.environ)
    for name, value in QUIET.items():
        os.environ.setdefault(name, value)
    own_home = server_files().folder / "prefect"
    if os.environ.setdefault("PREFECT_HOME", str(own_home)) == str(own_home):
        # Prefect makes no parents, and an embedded server then takes 25 s more.
        own_home.mkdir(parents=True, exist_ok=True)
    if choice == EMBEDDED:
        os.environ.pop("PREFECT_API_URL", None)
        credentials = f"planetpose:{secrets.token_urlsafe(24)}"  # other users of this machine reach it too
        os.environ |= {AUTHENTICATION: credentials, CLIENT_AUTHENTICATION: credentials}
        return
    os.environ["PREFECT_API_URL"] = ensure_server() if choice == LOCAL else choice
    local = server_files().read()
    if local and local.url == os.environ["PREFECT_API_URL"]:
        os.environ[CLIENT_AUTHENTICATION] = local.credentials
    if choice != LOCAL:
        with said_when_it_takes_long(f"waiting for the Prefect server at {choice}"):
            check_reachable(choice, aside)


@contextmanager
def server_at_hand(choice: str) -> Iterator[None]:
    """The server that `prepare` has chosen is up within the `with` block; an embedded one is started, and the user is
    informed when that takes long."""
    from prefect.client.orchestration import get_client

    if choice != EMBEDDED:
        yield
        return
    with ExitStack() as stack:
        with said_when_it_takes_long("waiting for the embedded Prefect server; its start takes 10 to 20 s"):
            stack.enter_context(get_client(sync_client=True))
        yield


def server_is_lost() -> bool:
    """Whether Prefect was used in this process and its server does not answer any more; at exit Prefect would then try
    for minutes to send it what happened."""
    url = os.environ.get("PREFECT_API_URL")
    if "prefect" not in sys.modules or not url:
        return False
    try:
        with open_url(f"{url}/health", HEALTH_TIMEOUT_S):
            return False
    except urllib.error.HTTPError:  # it answers, if only to say no
        return False
    except (OSError, ValueError):
        return True
