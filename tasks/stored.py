"""What steps leave for later steps: arrays in Zarr beside the record.

The last few images are kept in memory, so that the steps of one image that run in one process load them once.
"""

from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.observation import Observation

ARRAYS = "arrays.zarr"
IMAGES_IN_MEMORY = 4


def save_arrays(folder: Path, **arrays: NDArray[Any]) -> None:
    """Write named arrays into `folder`, one chunk each, by the compressor that costs least time."""
    import zarr
    from zarr.codecs import BloscCodec

    fast = BloscCodec(cname="lz4", clevel=1, shuffle="shuffle")
    group = zarr.open_group(str(folder / ARRAYS), mode="w")
    for name, values in arrays.items():
        stored = group.create_array(
            name,
            shape=values.shape,
            dtype=values.dtype,
            chunks=tuple(max(n, 1) for n in values.shape),
            compressors=[fast],
        )
        stored[...] = values


def load_arrays(folder: Path) -> dict[str, NDArray[Any]]:
    """All arrays that `save_arrays` wrote into `folder`."""
    import zarr

    group = zarr.open_group(str(folder / ARRAYS), mode="r")
    return {name: np.asarray(stored[...]) for name, stored in group.arrays()}


def save_observation(folder: Path, observation: Observation) -> None:
    """Write image, noise and quality into `folder`."""
    save_arrays(folder, image=observation.image, noise=observation.noise, quality=observation.quality)


@lru_cache(maxsize=IMAGES_IN_MEMORY)
def load_observation(folder: Path) -> Observation:
    """What `save_observation` wrote; its arrays are read-only, for they are shared."""
    arrays = load_arrays(folder)
    for values in arrays.values():
        values.setflags(write=False)
    return Observation(**arrays)
