"""Huffman first-difference coding of the compressed Voyager images on the PDS CD-ROMs.

A line is its first pixel, then one code per difference to the pixel before. The code tree follows from the histogram of
all differences (-255 .. 255) in the file. After K. Becker's description of 1989 in the archive's own software; the
order of equal frequencies is part of the format.
"""

from bisect import bisect_left

import numpy as np
from numpy.typing import NDArray

DIFFERENCES = 511
ZERO_DIFFERENCE = 255  # index of the histogram's entry for equal neighbours
ROOT = 0


def code_tree(histogram: NDArray[np.int64]) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """children (n, 2), the node that a 0 and a 1 bit lead to, and symbol (n,), the difference's index or -1; root 0.

    The two rarest nodes are joined again and again, the rarer under 0; a joined node goes before others of its
    frequency. Raises ValueError when fewer than two differences occur.
    """
    occurring = [int(index) for index in np.argsort(histogram, kind="stable") if histogram[index] > 0]
    if len(occurring) < 2:
        raise ValueError("fewer than two differences occur in its encoding histogram")
    frequencies = [int(histogram[index]) for index in occurring]
    nodes: list[int | tuple] = list(occurring)
    while len(nodes) > 1:
        joined = (nodes.pop(0), nodes.pop(0))
        frequency = frequencies.pop(0) + frequencies.pop(0)
        place = bisect_left(frequencies, frequency)
        frequencies.insert(place, frequency)
        nodes.insert(place, joined)
    return _flattened(nodes[0])


def _flattened(root: int | tuple) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    children: list[list[int]] = [[ROOT, ROOT]]
    symbols = [-1]
    waiting = [(root, ROOT)]
    while waiting:
        node, place = waiting.pop()
        if isinstance(node, int):
            symbols[place] = node
            continue
        for bit, child in enumerate(node):
            children[place][bit] = len(symbols)
            waiting.append((child, len(symbols)))
            children.append([ROOT, ROOT])
            symbols.append(-1)
    return np.array(children, np.int32), np.array(symbols, np.int32)


def decode_lines(
    lines: list[bytes], width: int, children: NDArray[np.int32], symbols: NDArray[np.int32]
) -> tuple[NDArray[np.uint8], NDArray[np.int64]]:
    """Pixels (n, width) of n coded lines, and how many of each line its bytes held; the rest repeat the last one.

    All lines advance together, one bit at a time.
    """
    bits = _bit_table(lines)
    differences = np.zeros((len(lines), width), np.int64)
    differences[:, 0] = [line[0] if line else 0 for line in lines]
    filled = np.array([min(len(line), 1) for line in lines])
    available = np.array([8 * max(len(line) - 1, 0) for line in lines])
    node = np.zeros(len(lines), np.int32)
    for position in range(bits.shape[1]):
        active = (position < available) & (filled < width)
        if not active.any():
            break
        node = np.where(active, children[node, bits[:, position]], node)
        done = active & (symbols[node] >= 0)
        differences[done, filled[done]] = ZERO_DIFFERENCE - symbols[node[done]]
        filled += done
        node[done] = ROOT
    return (np.cumsum(differences, axis=1) % 256).astype(np.uint8), filled


def _bit_table(lines: list[bytes]) -> NDArray[np.uint8]:
    """The bits (n, longest) behind each line's first byte, most significant first, zeros behind its end."""
    longest = max((len(line) - 1 for line in lines), default=0)
    padded = b"".join(line[1:].ljust(longest, b"\0") for line in lines)
    return np.unpackbits(np.frombuffer(padded, np.uint8).reshape(len(lines), max(longest, 0)), axis=1)
