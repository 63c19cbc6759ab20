"""VICAR images of bytes: a label in one or more records, then the lines, each behind its prefix."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

PLAIN = str | int | float | tuple[int, ...]


def write_vicar_bytes(
    path: Path, image: NDArray[np.float32], keywords: dict[str, PLAIN], prefix_bytes: int = 0
) -> None:
    """Write `image` (nl, ns), rounded to bytes, with `keywords` behind those of the system label."""
    lines, samples = image.shape
    record = samples + prefix_bytes
    system: dict[str, PLAIN] = {
        "FORMAT": "BYTE",
        "TYPE": "IMAGE",
        "BUFSIZ": 20 * record,
        "DIM": 3,
        "EOL": 0,
        "RECSIZE": record,
        "ORG": "BSQ",
        "NL": lines,
        "NS": samples,
        "NB": 1,
        "N1": samples,
        "N2": lines,
        "N3": 1,
        "N4": 0,
        "NBB": prefix_bytes,
        "NLB": 0,
        "HOST": "X86-LINUX",
        "INTFMT": "LOW",
        "REALFMT": "RIEEE",
    }
    body = "  ".join(f"{name}={_text(value)}" for name, value in {**system, **keywords}.items())
    records = -(-(len(body) + 40) // record)
    label = f"LBLSIZE={records * record:<16d}{body}".encode("ascii").ljust(records * record, b"\0")
    content = np.zeros((lines, record), np.uint8)
    content[:, prefix_bytes:] = np.clip(np.rint(image), 0, 255).astype(np.uint8)
    path.write_bytes(label + content.tobytes())


def _text(value: PLAIN) -> str:
    if isinstance(value, tuple):
        return f"({','.join(map(str, value))})"
    return "'" + value.replace("'", "''") + "'" if isinstance(value, str) else str(value)
