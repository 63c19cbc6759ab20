"""Image lists: which images there are, where they are fetched from, and what belongs to each.

`load_image_list` reads a CSV, TOML or Parquet file, or a list of the catalog by name; `write_image_list` writes one.
"""

from catalog.lists.loading import find_list, known_lists, load_image_list, read_image_list, write_image_list
from catalog.lists.model import ImageEntry, ImageList

__all__ = [
    "ImageEntry",
    "ImageList",
    "find_list",
    "known_lists",
    "load_image_list",
    "read_image_list",
    "write_image_list",
]
