"""Hostile scenes drawn at random: of each kind as many as wanted, every one of another body, camera, size, phase, light
and noise. Each has one planted cause; what counts is the first sentence of the reason.

Run it for the whole table: python tests/simulated/helpers/drawn_scenes.py SEED [KIND ...]
"""

import sys
import tempfile
from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from drawn_metadata import (
    another_face,
    behind,
    cut_by_the_frame,
    limb_outside,
    map_of_another,
    mirrored,
    negative,
    other_camera,
    other_mode,
    other_range,
    other_target,
    outside,
    quarter_turned,
    sun_of_another_time,
    sun_turned,
    too_large,
    too_small,
)
from drawn_pictures import (
    blurred,
    clouded,
    compressed,
    eclipsed,
    hot_pixels,
    limb_saturated,
    masked,
    missing_lines,
    moon_beside,
    noise_only,
    planet_behind,
    planet_beside,
    saturated,
    smeared,
    stray_light,
    too_faint,
    truncated,
    zero_filled,
)
from hostile import Hostile, corrected, is_reported, off_px

KINDS: tuple[Callable[[np.random.Generator], Hostile], ...] = (
    other_range,
    other_mode,
    other_camera,
    other_target,
    sun_turned,
    sun_of_another_time,
    mirrored,
    quarter_turned,
    negative,
    noise_only,
    outside,
    too_faint,
    clouded,
    map_of_another,
    another_face,
    saturated,
    limb_saturated,
    hot_pixels,
    missing_lines,
    zero_filled,
    truncated,
    blurred,
    smeared,
    planet_beside,
    planet_behind,
    moon_beside,
    cut_by_the_frame,
    limb_outside,
    masked,
    eclipsed,
    stray_light,
    compressed,
    behind,
    too_small,
    too_large,
)


def scenes(seed: int, each: int = 2, kinds: tuple[str, ...] = ()) -> Iterator[Hostile]:
    """`each` of every kind, or of those named; the same ones for the same seed."""
    for number in range(each):
        for place, kind in enumerate(KINDS):
            if not kinds or kind.__name__ in kinds:
                rng = np.random.default_rng([seed, place, number])
                yield replace(kind(rng), name=f"{kind.__name__}-{seed}-{number}")


def main(seed: int, kinds: tuple[str, ...], each: int = 2) -> int:
    """Print the table; 1 when less than nine in ten reasons name the cause."""
    counts: dict[str, list[int]] = defaultdict(lambda: [0, 0])
    with tempfile.TemporaryDirectory() as place:
        for scene in scenes(seed, each, kinds):
            result = corrected(scene, Path(place))
            named, away = is_reported(scene, result), off_px(scene, result)
            kind = scene.name.partition("-")[0]
            counts[kind] = [counts[kind][0] + named, counts[kind][1] + 1]
            where = "" if away is None else f" [{away:.2f} px off]"
            print(f"{'yes' if named else 'NO '} {scene.name:26s} {scene.cause:11s} {scene.target:8s} "
                  f"{result['status']}{where} {(result['reason'] or '')[:260]}", flush=True)  # fmt: skip
    reported, count = (sum(column) for column in zip(*counts.values(), strict=True))
    for kind, (good, all_) in counts.items():
        print(f"{kind:22s} {good}/{all_}")
    print(f"{reported} of {count} reasons name the planted cause")
    return 0 if reported >= 0.9 * count else 1


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]), tuple(sys.argv[2:])))
