"""The scenes: a table that follows from nothing but the files that this one imports."""

from functools import cache

import numpy as np

from lab.honesty import table_contradictions, table_pictures, table_recording  # noqa: F401  they register their groups
from lab.honesty.scene import MASTER_SEED, Scene
from lab.honesty.table_surfaces import GROUPS

__all__ = ["GROUPS", "all_scenes"]


# Seeds of another draw's scenes are so far from those of this one.
APART = 1_000_000


@cache
def all_scenes(draw: int = 0) -> tuple[Scene, ...]:
    """Every scene, in the order of groups. draw: another number draws all that is random anew, of the same groups."""
    scenes: list[Scene] = []
    for number, (name, function) in enumerate(GROUPS.items()):
        random = np.random.default_rng([MASTER_SEED, 7, number, *([draw] if draw else [])])
        for place, fields in enumerate(function(random)):
            seed = 1000 * (number + 1) + place + APART * draw
            scenes.append(Scene(f"{name}-{place:03d}", name, seed, **fields))
    return tuple(scenes)
