"""What notebooks show: the page of `planetpose view`, served by a thread of the notebook's own process, and a widget
that needs no server."""

import html
import threading
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import quote

from catalog.errors import RefusedError
from catalog.reasons import Reason
from viewer.app import build_app
from viewer.security import Access
from viewer.serving import listening_socket, quiet_server

if TYPE_CHECKING:
    from viewer.widget import ImageWidget


class View:
    """A page that a notebook shows where this object is a cell's value. url: the page's address; it holds a token,
    without which no other page can show it in a frame."""

    def __init__(self, store: Path, access: Access, product: str | None, height: int, compare: Path | None) -> None:
        self.store, self.height, self._product = Path(store), height, product
        self._access = access
        self._server = quiet_server(build_app(self.store, access, compare))

    @property
    def url(self) -> str:
        """Address of the page, at the product if one was given."""
        return f"{self._access.url()}#{quote(self._product)}" if self._product else self._access.url()

    def close(self) -> None:
        """End the server."""
        self._server.should_exit = True

    def _repr_html_(self) -> str:
        style = f"width: 100%; height: {self.height}px; border: 0"
        allowed = 'allow="clipboard-write"'
        return f'<iframe src="{html.escape(self.url)}" style="{style}" title="planetpose view" {allowed}></iframe>'

    def __repr__(self) -> str:
        return f"planetpose view of {self.store}: {self.url}"


def view(
    store: Path | str,
    product: str | None = None,
    height: int = 700,
    read_only: bool = False,
    compare: Path | str | None = None,
) -> View:
    """The page of `planetpose view` for a notebook's cell: table, image with layers, values under the mouse, decisions,
    help and redo.

    product: shown first. height: of the page, pixels. read_only: nothing can be changed. compare: a second store. The
    server is a thread of this process and listens on this machine only, so the browser must be on this machine too.
    Raises RefusedError when there is no store.
    """
    listening = listening_socket("127.0.0.1", 0)
    access = Access("127.0.0.1", listening.getsockname()[1], read_only, framed=True)
    with ExitStack() as on_error:
        on_error.callback(listening.close)
        made = View(Path(store), access, product, height, Path(compare) if compare else None)
        on_error.pop_all()
    run = made._server.run
    threading.Thread(target=run, kwargs={"sockets": [listening]}, daemon=True, name=f"view of {store}").start()
    return made


def widget(store: Path | str, product: str | None = None, height: int = 500) -> "ImageWidget":
    """The picture of an image as a widget: planes, stretch, layers and the values under the mouse. Everything goes
    through the notebook's own connection, so it also works where the kernel runs on another machine.

    product: shown first. height: of the picture, pixels. The widget's `product` is the image that is shown, `places`
    what was clicked. Raises RefusedError when there is no store, or no such product in it; ModuleNotFoundError where
    anywidget is not installed (`pip install 'planetpose[notebook]'`).
    """
    try:
        from viewer.widget import ImageWidget
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError("The widget needs anywidget: pip install 'planetpose[notebook]'") from error
    made = ImageWidget(Path(store), product, height)
    if product is not None and product not in made.side.table.places:
        raise RefusedError(
            Reason.PRODUCT_MISSING, f"{store} has no product {product}.", "planetpose status lists them."
        )
    return made
