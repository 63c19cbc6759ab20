"""Publish: the cube, its picture and its papers, as one folder that appears whole (paper, section 6)."""

from tasks.publish.product import publish, redraw_overlay, write_product
from tasks.publish.publication import Publication

__all__ = ["Publication", "publish", "redraw_overlay", "write_product"]
