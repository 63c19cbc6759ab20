"""The overlay that a page takes along as text."""

import base64
from pathlib import Path

import cv2
import numpy as np
import pytest
from small_product import small_publication

from tasks.pictures.embedded import SIDE_PX, overlay_in_markdown
from tasks.publish import publish
from tasks.publish.names import OVERLAY


@pytest.fixture
def product(tmp_path: Path) -> Path:
    """A published product's folder."""
    publish(small_publication("C0001"), tmp_path / "out")
    return tmp_path / "out" / "C0001"


@pytest.mark.parametrize("size_px", [(60, 40), (3 * SIDE_PX, 2 * SIDE_PX)])
def test_the_overlay_is_a_jpeg_of_limited_size(product: Path, size_px: tuple[int, int]) -> None:
    cv2.imwrite(str(product / OVERLAY), np.full((size_px[1], size_px[0], 3), 90, np.uint8))
    text = overlay_in_markdown(product)
    assert text is not None
    head, _, encoded = text.removesuffix(")").partition("base64,")
    assert head == "![C0001](data:image/jpeg;"
    picture = cv2.imdecode(np.frombuffer(base64.b64decode(encoded), np.uint8), cv2.IMREAD_COLOR)
    assert picture is not None
    assert max(picture.shape) == min(max(size_px), SIDE_PX)
    assert abs(float(picture.mean()) - 90) < 3


@pytest.mark.parametrize("content", [None, b"", b"no picture at all"])
def test_without_a_readable_overlay_there_is_none(product: Path, content: bytes | None) -> None:
    if content is None:
        (product / OVERLAY).unlink(missing_ok=True)
    else:
        (product / OVERLAY).write_bytes(content)
    assert overlay_in_markdown(product) is None


def test_an_overlay_that_links_elsewhere_is_not_taken(product: Path, tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "private.png"), np.zeros((8, 8, 3), np.uint8))
    (product / OVERLAY).unlink(missing_ok=True)
    (product / OVERLAY).symlink_to(tmp_path / "private.png")
    assert overlay_in_markdown(product) is None
