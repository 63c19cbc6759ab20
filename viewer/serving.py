"""Runs the server until it is interrupted."""

import socket
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import quote

import typer

from catalog.errors import WrongOptionError
from tasks.boundary import trouble_of
from viewer.app import build_app
from viewer.security import Access

if TYPE_CHECKING:
    import uvicorn
    from fastapi import FastAPI


def serve(
    store: Path,
    host: str,
    port: int,
    read_only: bool,
    compare: Path | None,
    open_page: bool,
    product: str | None = None,
) -> None:
    """Serve the page of `store`, at `product` if one is given, and say where it is. Raises RefusedError without a
    store, WrongOptionError for a host or port that cannot be listened on."""
    from flows.cli.show import on_a_desk

    listening = listening_socket(host, port)
    access = Access(host, listening.getsockname()[1], read_only)
    app = build_app(store, access, compare)
    warm_up(store)
    url = access.url() + (f"#{quote(product)}" if product else "")
    print(f"planetpose view: {url}  (Ctrl-C ends it)", flush=True)
    if not access.is_local:
        print("Everybody who knows this address with its token can use the page; it is not encrypted.", flush=True)
    if open_page and on_a_desk():
        typer.launch(url)
    quiet_server(app).run(sockets=[listening])


def quiet_server(app: "FastAPI") -> "uvicorn.Server":
    """A server of the application that logs warnings alone."""
    import uvicorn

    return uvicorn.Server(uvicorn.Config(app, log_level="warning", access_log=False, server_header=False))


def warm_up(store: Path) -> None:
    """Import what the first picture needs, so that nobody waits for it in front of the page."""
    import numpy as np

    from tasks.publish.index import read_index
    from viewer.planes import Planes
    from viewer.product import product_page

    index = read_index(store)
    first = None if index is None or not len(index) else str(index["product"].iloc[0])
    if first is None:
        return
    planes = Planes(store)

    def draw() -> None:
        product_page(planes, first)
        np.nanmax(planes.plane(first, "image"))

    trouble_of(draw, first, log=False)


def listening_socket(host: str, port: int) -> socket.socket:
    """A socket that listens there; it is bound before anything else, so that a taken port is said at once."""
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        made = socket.socket(family, kind, protocol)
        made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        made.bind(address)
        made.listen()
    except OSError as error:
        remedy = "Choose another --port, or 0 for any that is free."
        raise WrongOptionError("port", f"{host}:{port} cannot be listened on ({error}).", remedy) from error
    return made
