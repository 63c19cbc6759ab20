"""Ways to damage a file, all decided by one random generator."""

import re
from collections.abc import Callable

import numpy as np

Generator = np.random.Generator
HEAD_BYTES = 8192
BLOCK_BYTES = 512
NUMBERS = (
    b"0", b"-1", b"1", b"2", b"999999999", b"-2147483648", b"4294967296", b"18446744073709551616", b"20001", b"1e9",
    b"1e400", b"-999", b"nan", b"inf", b"1.5", b"'", b"(", b")", b"", b"0x10", b"99999999999999999999999999",
)  # fmt: skip
WORDS = (
    b"",
    b"'",
    b"\0",
    b"N/A",
    b"NULL",
    b"(1,2,3)",
    b"x" * 300,
    b"../../../etc/passwd",
    b"$(reboot)",
    b"\xff\xfe",
    b"\r\n",
)


def few_bits(content: bytes, random: Generator) -> bytes:
    """1 to 64 bits turned over, anywhere."""
    return _flipped(content, len(content), random)


def bits_in_the_head(content: bytes, random: Generator) -> bytes:
    """1 to 64 bits turned over where the label is."""
    return _flipped(content, min(HEAD_BYTES, len(content)), random)


def _flipped(content: bytes, reach: int, random: Generator) -> bytes:
    damaged = bytearray(content)
    for place in random.integers(0, max(reach, 1), int(random.integers(1, 65))):
        damaged[place] ^= 1 << int(random.integers(0, 8))
    return bytes(damaged)


def cut(content: bytes, random: Generator) -> bytes:
    """The end missing, often nearly all of it."""
    fraction = random.random() ** random.choice([1, 4, 12])
    return content[: int(fraction * len(content))]


def put_in(content: bytes, random: Generator) -> bytes:
    """1 to 2000 random bytes put in."""
    place = _place(content, random)
    return content[:place] + random.bytes(int(random.integers(1, 2000))) + content[place:]


def taken_out(content: bytes, random: Generator) -> bytes:
    """1 to 2000 bytes missing."""
    place = _place(content, random)
    return content[:place] + content[place + int(random.integers(1, 2000)) :]


def blocks_swapped(content: bytes, random: Generator) -> bytes:
    """Two blocks of 512 bytes in each other's place."""
    blocks = [content[i : i + BLOCK_BYTES] for i in range(0, len(content), BLOCK_BYTES)]
    a, b = (int(i) for i in random.integers(0, [min(16, len(blocks)), len(blocks)]))
    blocks[a], blocks[b] = blocks[b], blocks[a]
    return b"".join(blocks)


def blocks_blank(content: bytes, random: Generator) -> bytes:
    """Up to 40 blocks of one value, as lost packets and bad sectors leave them."""
    damaged = bytearray(content)
    for _ in range(int(random.integers(1, 41))):
        place = _place(content, random)
        end = min(place + BLOCK_BYTES, len(damaged))
        damaged[place:end] = bytes([int(random.choice([0, 32, 255]))]) * (end - place)
    return bytes(damaged)


def number_changed(content: bytes, random: Generator) -> bytes:
    """A number of the label replaced, with the bytes after it kept in their places or moved."""
    return _replaced(content, rb"-?\d+(\.\d+)?", NUMBERS, random)


def digit_changed(content: bytes, random: Generator) -> bytes:
    """One to three digits of the label replaced by others."""
    damaged = bytearray(content)
    digits = [match.start() for match in re.finditer(rb"\d", content[:HEAD_BYTES])]
    for place in random.choice(digits, int(random.integers(1, 4))) if digits else ():
        damaged[place] = ord("0") + int(random.integers(0, 10))
    return bytes(damaged)


def word_changed(content: bytes, random: Generator) -> bytes:
    """A word of the label replaced."""
    return _replaced(content, rb"[A-Za-z_]{3,}", WORDS, random)


def head_repeated(content: bytes, random: Generator) -> bytes:
    """The beginning once more in front, or further down."""
    head = content[: int(random.integers(1, HEAD_BYTES))]
    place = int(random.choice([0, len(head), len(content)]))
    return content[:place] + head + content[place:]


def _replaced(content: bytes, pattern: bytes, values: tuple[bytes, ...], random: Generator) -> bytes:
    matches = list(re.finditer(pattern, content[:HEAD_BYTES]))
    if not matches:
        return bits_in_the_head(content, random)
    match = matches[int(random.integers(0, len(matches)))]
    value = values[int(random.integers(0, len(values)))]
    end = match.end() if random.random() < 0.5 else match.start() + len(value)
    return content[: match.start()] + value + content[end:]


def _place(content: bytes, random: Generator) -> int:
    """In the head as often as anywhere."""
    reach = min(HEAD_BYTES, len(content)) if random.random() < 0.5 else len(content)
    return int(random.integers(0, max(reach, 1)))


DAMAGES: dict[str, Callable[[bytes, Generator], bytes]] = {
    function.__name__.replace("_", " "): function
    for function in (
        few_bits, bits_in_the_head, cut, put_in, taken_out, blocks_swapped, blocks_blank, number_changed, digit_changed,
        word_changed, head_repeated,
    )
}  # fmt: skip
