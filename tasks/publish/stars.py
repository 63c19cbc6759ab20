"""What a product says of the stars of its image."""

from pathlib import Path
from typing import Any

from catalog.errors import RefusedError
from catalog.plain_files import own_json
from catalog.reasons import Reason
from catalog.regular_file import read_regular_text
from tasks.publish.names import RESULT

Json = dict[str, Any]


def stars_of_product(folder: Path) -> Json:
    """The result's `stars` of a product's folder; empty for one made before there were any. Raises RefusedError where
    the result cannot be read."""
    path = folder / RESULT
    try:
        return own_json(read_regular_text(path)).get("stars") or {}
    except (OSError, ValueError, AttributeError) as error:
        fault = f"{path} cannot be read ({error})."
        raise RefusedError(Reason.PRODUCT_UNREADABLE, fault, "Correct the image again.") from error
