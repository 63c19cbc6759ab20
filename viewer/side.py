"""One store as the page sees it."""

from pathlib import Path
from typing import TYPE_CHECKING

from fastapi import HTTPException

from catalog.errors import RefusedError
from catalog.reasons import Reason
from viewer.planes import TILE_PX, Planes
from viewer.table import Table

if TYPE_CHECKING:
    import xarray as xr


class Side:
    """One store with its table and planes."""

    def __init__(self, store: Path, tile_px: int = TILE_PX) -> None:
        self.store = Path(store)
        self.table, self.planes = Table(self.store), Planes(self.store, tile_px)

    def known(self, product: str) -> str:
        """The product's name. Raises HTTPException for one that is not in the store's table: nothing else is served."""
        if product not in self.table.places:
            raise HTTPException(404, "The store has no such product.")
        return product

    def confirmed(self, product: str) -> "xr.Dataset":
        """The cube of a product. Raises RefusedError for a failed image: it confirms no pose."""
        if not self.planes.has_product(self.known(product)):
            fault = f"{product} failed: no pose of it is confirmed, so it has no coordinates."
            raise RefusedError(Reason.PRODUCT_MISSING, fault, "Help the correction.")
        return self.planes.cube(product)


def side_of(sides: list[Side], number: int) -> Side:
    """The store of that number. Raises RefusedError for another."""
    if not 0 <= number < len(sides):
        raise RefusedError(Reason.STORE_MISSING, "there is no second store.", "Give one with --compare.")
    return sides[number]
