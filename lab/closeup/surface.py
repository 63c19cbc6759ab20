"""Surfaces that the base map of the catalog gets wrong: other maps of the same body where there are any, else the map
itself with planted errors."""

from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from catalog.target import known_targets
from lab.honesty.solids import COLUMNS, ROWS, grain, packaged_texture, with_map_errors

Array = NDArray[np.float64]
Texture = NDArray[np.float32]

# Maps of others than the catalog's among the real mission files: name and east longitude of the left edge.
OTHER_MAPS = {"europa": ("europa_4096_left180E.jpg", 180.0), "io": ("io_4096_left180E.jpg", 180.0)}
# Planted: albedo that the map does not have, contrast, and by how far the map's markings are misplaced, map pixels RMS.
TILE_PX, LEAST_RESPONSE = 128, 0.15
NOISE, CONTRASTS, MISPLACED_PX = 0.06, (0.7, 1.3), 0.2


@cache
def catalog_texture(target: str) -> Texture:
    """The catalog's base map of a target, relative to its mean, east longitude from 0."""
    return packaged_texture(str(known_targets()[target].basemap))


def true_texture(target: str, seed: int, maps: Path | None) -> Texture:
    """The surface of a target. maps: folder of other maps, None without. Another map is moved as a whole to the frame
    of the catalog's, so that what is left is its own errors, not the difference of two conventions."""
    other = other_texture(target, maps) if maps and target in OTHER_MAPS else None
    if other is not None:
        return other
    random = np.random.default_rng([73, seed])
    changed = with_map_errors(catalog_texture(target), seed % 5, NOISE, float(random.uniform(*CONTRASTS)))
    return misplaced(changed, seed % 5)


def misplaced(texture: Texture, seed: int) -> Texture:
    """The same with markings smoothly moved by MISPLACED_PX (RMS along each axis) over some degrees."""
    import cv2

    rows, columns = texture.shape
    x, y = np.meshgrid(np.arange(columns), np.arange(rows))
    moves = [cv2.resize(grain(100 + 2 * seed + axis), (columns, rows)) * MISPLACED_PX for axis in (0, 1)]
    at = [(place + move).astype(np.float32) for place, move in zip((x, y), moves, strict=True)]
    moved: Texture = cv2.remap(texture, at[0], at[1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return moved


@cache
def other_texture(target: str, maps: Path) -> Texture | None:
    """Another map of a target in the frame of the catalog's; None where its file is not there."""
    import cv2

    name, left_deg = OTHER_MAPS[target]
    grey = cv2.imread(str(maps / name), cv2.IMREAD_GRAYSCALE)
    if grey is None:
        return None
    small = cv2.resize(grey.astype(np.float32), (COLUMNS, ROWS), interpolation=cv2.INTER_AREA)
    small = np.roll(small / small.mean(), round(left_deg / 360 * COLUMNS), axis=1)
    north, east = frame_difference_px(small, catalog_texture(target))
    matrix = np.array([[1, 0, -east], [0, 1, -north]], np.float32)
    wide = cv2.copyMakeBorder(small, 0, 0, 8, 8, cv2.BORDER_WRAP)
    moved: Texture = cv2.warpAffine(wide, matrix, wide.shape[::-1], borderMode=cv2.BORDER_REPLICATE)[:, 8:-8]
    return moved


def frame_difference_px(texture: Texture, other: Texture) -> tuple[float, float]:
    """By how much (rows, columns) `texture` must be moved back to lie as `other` does: median of the phase correlations
    of tiles, away from the poles, of what is finer than some degrees."""
    import cv2

    fine = [(t - cv2.GaussianBlur(t, (0, 0), 12)).astype(np.float64) for t in (other, texture)]
    taper = cv2.createHanningWindow((TILE_PX, TILE_PX), cv2.CV_64F)
    moves = []
    for y in range(ROWS // 5, ROWS - ROWS // 5 - TILE_PX, TILE_PX):
        for x in range(0, COLUMNS, TILE_PX):
            one, two = (part[y : y + TILE_PX, x : x + TILE_PX].copy() for part in fine)
            (east, south), response = cv2.phaseCorrelate(one, two, taper)
            if response > LEAST_RESPONSE:
                moves.append((south, east))
    south, east = np.median(moves, axis=0)
    return float(south), float(east)
