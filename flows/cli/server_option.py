"""The option --server, as every command that runs a Prefect flow has it."""

from typing import Annotated
from urllib.parse import urlsplit

import typer


def known_server(option: str | None) -> str | None:
    """The option as it is; what it and the environment come to must be a server, or it is wrong usage."""
    from flows.prefect_settings import EMBEDDED, LOCAL, server_choice

    choice = server_choice(option)
    if choice not in (EMBEDDED, LOCAL) and not is_address(choice):
        fault = f"{choice!r} is neither {LOCAL}, {EMBEDDED} nor the URL of an API such as http://127.0.0.1:4200/api."
        raise typer.BadParameter(fault)
    return option


def is_address(text: str) -> bool:
    """Whether a text has the form of an API's URL."""
    try:
        parts = urlsplit(text)
        return parts.scheme in ("http", "https") and bool(parts.hostname)
    except ValueError:
        return False


Server = Annotated[
    str | None,
    typer.Option(help="Prefect server: local, embedded, or the URL of an API.", callback=known_server),
]
