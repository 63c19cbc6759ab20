"""The scenes: a table that follows from nothing but the files that this one imports."""

from functools import cache

import numpy as np

from lab.honesty import table_contradictions, table_pictures  # noqa: F401  they register their groups
from lab.honesty.scene import MASTER_SEED, Scene
from lab.honesty.table_surfaces import GROUPS

__all__ = ["GROUPS", "all_scenes"]


@cache
def all_scenes() -> tuple[Scene, ...]:
    """Every scene, in the order of groups."""
    scenes: list[Scene] = []
    for number, (name, function) in enumerate(GROUPS.items()):
        random = np.random.default_rng([MASTER_SEED, 7, number])
        for place, fields in enumerate(function(random)):
            scenes.append(Scene(f"{name}-{place:03d}", name, 1000 * (number + 1) + place, **fields))
    return tuple(scenes)
