"""The store's index follows what is published, and never stands in its way."""

import logging
from pathlib import Path
from typing import Any

from flows.verdict import PUBLISHED

logger = logging.getLogger("planetpose")


def note_in_index(store: Path, result: dict[str, Any]) -> None:
    """Bring the index of `store` up to date when `result` is of an image that was published just now."""
    if result["status"] in PUBLISHED and "publish" not in result["cached"]:
        index_store(store)


def index_store(store: Path) -> None:
    """Bring the index of `store` up to date."""
    from tasks.publish.index import open_index

    try:
        open_index(store)
    except OSError as error:  # the products are there all the same, and the next reader brings it up to date
        logger.warning("the index of %s was not written: %s", store, error)
