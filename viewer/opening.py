"""What opening an image takes: its page and the picture that is seen first, in one answer."""

import json
import struct
from typing import Any

from tasks.boundary import trouble_of
from viewer.planes import opening_level
from viewer.product import advice_of, papers, product_page
from viewer.side import Side


def page_of(side: Side, product: str) -> dict[str, Any]:
    """The page of a product: row of the table, what its reason means, geometry and curves where it has a picture.
    Raises HTTPException for a name that is not in the table, RefusedError for a damaged product."""
    row = side.table.row(side.known(product)) or {}
    seen = {"row": row, "advice": advice_of(row.get("reason")), "ranks": side.table.ranks(product)}
    seen["worst"] = side.table.worst(product)
    if row.get("status") == "unreadable" or side.planes.place(product) is None:
        return {**papers(side.store, product), **seen}
    return {**product_page(side.planes, product), **seen}


def opening_of(side: Side, product: str, plane: str) -> bytes:
    """The page and the tiles of a plane at the level that is drawn first, so that an image takes one request.

    Layout: bytes of the JSON as little-endian uint32; the JSON, filled up by spaces to a multiple of four; all tiles of
    the level `opening.level` of `opening.plane`, row by row, each as little-endian float32. There are no tiles where
    the plane cannot be read; the page then asks for it and shows why.
    """
    page, tiles = page_of(side, product), b""
    if "size_px" in page:
        nx, ny = page["size_px"]
        level = opening_level((ny, nx))

        def read() -> None:
            nonlocal tiles
            tiles = side.planes.tiles(product, plane, level)

        if trouble_of(read, product, log=False) is None:
            page["opening"] = {"plane": plane, "level": level}
    text = json.dumps(page, allow_nan=False, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    return struct.pack("<I", len(text)) + text + tiles
