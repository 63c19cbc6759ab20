"""PDS3 labels, parsed by pvl: detached (.LBL beside the image) or in the head of the file."""

from datetime import UTC, date, datetime
from pathlib import Path
from typing import Any

from catalog.bounded_pvl import MAX_LABEL_BYTES, load_pvl
from catalog.detached import label_beside
from catalog.regular_file import read_regular


def detached_label(path: Path) -> dict[str, Any]:
    """The keywords of the label that lies beside an image (same name, .LBL or .lbl), {} when there is none.

    A label that cannot be parsed does not stop an image that carries its own: its fault is kept as PDS_LABEL_FAULT.
    """
    beside = label_beside(path)
    if beside is None or beside.stat().st_size > MAX_LABEL_BYTES:
        return {}
    try:
        return parse_label(read_regular(beside, MAX_LABEL_BYTES).decode("latin-1"))
    except ValueError as error:
        return {"PDS_LABEL_FAULT": f"{beside.name}: {error}"}


def parse_label(content: str) -> dict[str, Any]:
    """The label's top-level keywords: times as ISO text, quantities as their number (times in seconds), the rest as is.

    Raises ValueError when the text is no sound label, or larger or deeper nested than any image's.
    """
    module = load_pvl(content)
    return {str(key): _plain(value) for key, value in module.items() if not hasattr(value, "items")}


def _plain(value: Any) -> Any:
    units = getattr(value, "units", None)
    if units is not None:
        milliseconds = str(units).upper() in ("MS", "MSEC", "MILLISECOND", "MILLISECONDS")
        return value.value / 1000 if milliseconds and isinstance(value.value, (int, float)) else value.value
    if isinstance(value, datetime):
        return (value.astimezone(UTC) if value.tzinfo else value).replace(tzinfo=None).isoformat()
    return value.isoformat() if isinstance(value, date) else value
