"""The picture of an image as a notebook's widget: all that it shows goes through the widget's own channel, so it also
works where the browser cannot reach the kernel's machine. Needs `planetpose[notebook]`."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import anywidget
import traitlets
from fastapi import HTTPException

from catalog.errors import PlanetposeError
from tasks.position.model import position_model
from tasks.position.position import positions_of_pixels
from viewer.app import STATIC
from viewer.opening import opening_of
from viewer.side import Side

# The page's modules that the widget is made of, in an order in which each finds what it imports.
MODULES = ("answers.js", "colours.js", "tiles.js", "picture.js", "hover.js", "widget.js")
IMPORT = re.compile(r"^import .*;\n", re.MULTILINE)
EXPORT = re.compile(r"^export ", re.MULTILINE)
TILE_PX = 256  # smaller than the page's: what hovering needs goes through a notebook's connection
MOST_NAMES = 2000  # in the list of images; others are shown by setting `product`
MOST_PLANES = 32


def module_text() -> str:
    """The widget's JavaScript: the page's modules within one function, so that each cell has its own."""
    inside = "".join(EXPORT.sub("", IMPORT.sub("", (STATIC / name).read_text(encoding="utf-8"))) for name in MODULES)
    return f"function render({{ model, el }}) {{\n{inside}\nreturn closed;\n}}\nexport default {{ render }};\n"


class ImageWidget(anywidget.AnyWidget):
    """The picture of an image with its layers and the values under the mouse.

    product: the image that is shown; set it to show another one. products: names in the list, of large stores the first
    ones. places: what was clicked, each as `Position.to_dict` has it (degrees, km, pixels). height: of the picture,
    pixels.
    """

    _esm = module_text()
    _css = (STATIC / "widget.css").read_text(encoding="utf-8")
    product = traitlets.Unicode().tag(sync=True)
    products = traitlets.List(traitlets.Unicode()).tag(sync=True)
    places = traitlets.List(traitlets.Dict()).tag(sync=True)
    height = traitlets.Int(500).tag(sync=True)

    def __init__(self, store: Path, product: str | None, height: int) -> None:
        self.side = Side(store, TILE_PX)
        names = list(self.side.table.places)
        shown = product or next(iter(names), "")
        listed = names[:MOST_NAMES] if shown in names[:MOST_NAMES] else [shown, *names[:MOST_NAMES]]
        super().__init__(product=shown, products=listed, height=height)
        self.on_msg(self._answer)

    def _answer(self, _: object, content: dict[str, Any], __: object) -> None:
        answer, buffers = answer_of(self.side, content)
        self.send(answer, buffers=buffers)


def answer_of(side: Side, request: dict[str, Any]) -> tuple[dict[str, Any], list[bytes]]:
    """Answer of a request of the widget's browser part: JSON with the request's number, and bytes. What is wrong with a
    request or a product becomes `fault`, so that the notebook goes on."""
    number = request.get("number")
    work = WORK.get(str(request.get("ask")))
    if work is None:
        return {"number": number, "fault": "There is no such request."}, []
    try:
        found = work(side, request)
    except PlanetposeError as error:
        return {"number": number, "fault": str(error)}, []
    except HTTPException as error:
        return {"number": number, "fault": str(error.detail)}, []
    except (KeyError, TypeError, ValueError) as error:
        return {"number": number, "fault": f"The request is incomplete ({error})."}, []
    return ({"number": number}, [found]) if isinstance(found, bytes) else ({"number": number, "result": found}, [])


def opening(side: Side, request: dict[str, Any]) -> bytes:
    """Page and first picture, see `viewer.opening`."""
    return opening_of(side, str(request["product"]), str(request["plane"]))


def tiles(side: Side, request: dict[str, Any]) -> bytes:
    """A tile of each plane, one after the other."""
    product = side.known(str(request["product"]))
    place = [int(request[name]) for name in ("level", "column", "row")]
    if not 0 <= place[0] <= 16:
        raise ValueError("level")
    names = [str(name) for name in request["planes"]][:MOST_PLANES]
    return b"".join(side.planes.tile(product, name, *place) for name in names)


def at(side: Side, request: dict[str, Any]) -> dict[str, object]:
    """What is at a pixel."""
    model = position_model(side.confirmed(str(request["product"])))
    return positions_of_pixels(model, [[float(request["x"]), float(request["y"])]])[0].to_dict()


WORK: dict[str, Callable[[Side, dict[str, Any]], bytes | dict[str, object]]] = {
    "opening": opening,
    "tiles": tiles,
    "at": at,
}
