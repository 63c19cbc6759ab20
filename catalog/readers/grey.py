"""One grey picture of several channels."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.readers.bands import chosen_plane

COLOURS = ("red", "green", "blue")


def grey_of_colours(
    path: Path, channels: NDArray[Any], plane: str | None, names: Sequence[str] = COLOURS
) -> tuple[NDArray[Any], tuple[str, ...]]:
    """One picture (ny, nx) of colours (ny, nx, bands), and what the user ought to know of it.

    Equal channels are one grey picture. Others are averaged, which mixes the colours' exposures, unless `plane` names
    one. Raises RefusedError for a plane that there is not.
    """
    if plane is not None:
        return np.ascontiguousarray(channels[..., chosen_plane(path, names, plane)]), ()
    first = channels[..., 0]
    if all(
        np.array_equal(first, channels[..., band], equal_nan=first.dtype.kind == "f")
        for band in range(1, channels.shape[2])
    ):
        return np.ascontiguousarray(first), ()
    listed = ", ".join(names)
    remark = f"its colours ({listed}) are averaged to grey; --plane {names[0]} takes one of them"
    return channels.mean(axis=2, dtype=np.float32), (remark,)
