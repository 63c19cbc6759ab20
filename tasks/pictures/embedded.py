"""A product's overlay as a text that needs no other file, for pages that are kept elsewhere."""

import base64
from pathlib import Path

import cv2
import numpy as np

from catalog.errors import RefusedError
from catalog.regular_file import read_regular
from tasks.publish.contained import refuse_what_is_elsewhere
from tasks.publish.names import OVERLAY

SIDE_PX = 480
JPEG_QUALITY = 80


def overlay_in_markdown(folder: Path) -> str | None:
    """Markdown of the overlay of the product in `folder`, as a JPEG of at most `SIDE_PX` a side; None when there is no
    overlay that can be read."""
    try:
        refuse_what_is_elsewhere(folder)
        overlay = cv2.imdecode(np.frombuffer(read_regular(folder / OVERLAY), np.uint8), cv2.IMREAD_COLOR)
    except (OSError, RefusedError, cv2.error):
        return None
    if overlay is None:
        return None
    scale = SIDE_PX / max(overlay.shape[:2])
    small = cv2.resize(overlay, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA) if scale < 1 else overlay
    encoded, jpeg = cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    if not encoded:
        return None
    return f"![{folder.name}](data:image/jpeg;base64,{base64.b64encode(jpeg.tobytes()).decode()})"
