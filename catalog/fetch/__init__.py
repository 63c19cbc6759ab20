"""Getting files of an image list from archives or a mirror: whole and checked, or not at all."""

from catalog.fetch.item import Item, Outcome, fetch_item
from catalog.fetch.plan import item_of, planned_items
from catalog.fetch.settings import FetchSettings
from catalog.fetch.transfer import TransferError

__all__ = ["FetchSettings", "Item", "Outcome", "TransferError", "fetch_item", "item_of", "planned_items"]
