"""planetpose view STORE"""

from pathlib import Path
from typing import Annotated

import typer

from tasks.publish.names import CUBE


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(view)


def view(
    store: Annotated[
        Path, typer.Argument(metavar="STORE", help="A folder of products, or one of its products.", show_default=False)
    ],
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port of the page; 0: any free port.")] = 0,
    host: Annotated[
        str, typer.Option(help="Address where the page can be reached. Other machines need the token.")
    ] = "127.0.0.1",
    read_only: Annotated[bool, typer.Option("--read-only", help="The page only shows: no decisions, no redo.")] = False,
    compare: Annotated[
        Path | None,
        typer.Option(metavar="STORE", help="A second store to compare with, for example from before a change."),
    ] = None,
    export: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Write the page as files for a web server instead.")
    ] = None,
    only: Annotated[str, typer.Option(help="For --export: only images that fit this filter.")] = "",
    open_: Annotated[bool, typer.Option("--open/--no-open", help="Open a browser where there is a display.")] = True,
) -> None:
    """Open a page to look at a store and help its corrections: table, filters, image with layers, values under the
    mouse, help, decisions, redo."""
    product = None
    if (store / CUBE).is_dir():
        store, product = store.resolve().parent, store.resolve().name
    if export is not None:
        from viewer.export import export_store

        pages = export_store(store, export, only)
        print(f"{export / 'index.html'}: {pages} images")
        return
    from viewer.serving import serve

    serve(store, host, port, read_only, compare, open_, product)
