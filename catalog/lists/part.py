"""Parts of an image list that several runs do, each on its own: `2/4` is the second of four.

A product belongs to the part that its name's SHA-256 gives, whatever else is in the list: an image that is added moves
no other one into another part, and every machine splits the list alike.
"""

import hashlib
import re

PART = re.compile(r"([1-9][0-9]{0,5})/([1-9][0-9]{0,5})")


def parse_part(text: str) -> tuple[int, int]:
    """Number and count of `2/4`. Raises ValueError for anything else."""
    found = PART.fullmatch(text)
    number, count = (int(group) for group in found.groups()) if found else (1, 0)
    if number > count:
        raise ValueError(f"{text!r} is no part of a list; the second of four is 2/4.")
    return number, count


def checked_part(text: str | None) -> str | None:
    """The text as it is. Raises ValueError as `parse_part`."""
    if text is not None:
        parse_part(text)
    return text


def part_of(product: str, count: int) -> int:
    """Number, from 1, of the part of `count` that a product belongs to."""
    return int.from_bytes(hashlib.sha256(product.encode()).digest()[:8]) % count + 1
