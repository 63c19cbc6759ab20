"""How a body is turned: a global search for the sub-spacecraft point and north azimuth at which the base map's markings
are the image's."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.observation import Observation
from catalog.pose import Pose
from catalog.rotation import rotation_from_vector_deg, vector_deg_from_rotation
from tasks.attitude.markings import evidence_of, is_better, measurements, signed_root
from tasks.attitude.texture import Texture, blurred, texture_of
from tasks.compare.reduce import reduced_observation, reduced_scene, reduction_for
from tasks.compiled import compiled_reordered
from tasks.initial_pose.settings import MapSearchSettings
from tasks.simulate import Scene
from tasks.simulate.coarse_map import map_as_coarse_as
from tasks.simulate.window import disk_radius_px

Array = NDArray[np.float64]

# Sizes of markings that the grid is searched by, Gaussian widths in steps of the grid: with all that are larger the
# right orientation of three images was the 440th to 3887th of 68 760, between these it was the first.
BAND_SHARES = (1 / 3, 4 / 3)
# Steps of the climb from the grid, as shares of its own.
CLIMB_SHARES = (0.4, 0.4, 0.2, 0.2)
# The climb's first step, of the grid's, and its last, in pixels of the disk's middle.
FIRST_SHARE, LAST_PX = 0.5, 0.25


@dataclass(frozen=True)
class MapSearch:
    """turn: (3, 3), `camera_from_body` found is that of the start times this; None where no orientation stands out.
    sigmas: the evidence for the best one, next_sigmas: for the next distinct one, in sigmas. tried: how many
    orientations. followed: (n, 3, 3) the best of them, turns of the same start."""

    turn: Array | None
    sigmas: float | None = None
    next_sigmas: float | None = None
    tried: int = 0
    followed: Array | None = None

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        return {"sigmas": self.sigmas, "next_sigmas": self.next_sigmas, "tried": self.tried}


def search_map(
    observation: Observation, pose: Pose, scene: Scene, settings: MapSearchSettings, among: Array | None = None
) -> MapSearch:
    """The turn of the body, of all there are, at which its map's markings are the image's.

    `pose` knows centre, range and Sun; its orientation counts for nothing. Shading is taken out as in every test of
    markings (`texture_of`); a grid of orientations is searched at low resolution, and the best are climbed from and
    compared at the image's own. One stands out as in those tests: by its evidence, and by more than twice that of the
    next. among: (n, 3, 3) turns of `pose`, in place of the grid's, where an earlier search has followed them.
    """
    if disk_radius_px(pose, scene.camera, scene.target) < settings.least_radius_px:
        return MapSearch(None)
    n = reduction_for(pose, scene, settings.diameter_px)
    coarse = texture_of(reduced_observation(observation, n), pose, reduced_scene(scene, n))
    fine = texture_of(observation, pose, scene)
    if coarse is None or fine is None:
        return MapSearch(None)
    turns = grid_of_turns(settings.step_deg) if among is None else among
    scores = grid_scores(coarse, scene, turns, settings.step_deg)
    followed = turns[np.argsort(-scores)[: settings.followed]]
    scores, best = climbed_together(coarse, scene, followed, settings.step_deg)
    best = best[distinct_best(scores, best, settings.compared, settings.step_deg)]
    # What large markings leave open, those of half their size decide.
    scores, best = climbed_together(coarse, scene, best, settings.step_deg / 2)
    starts = [best[i] for i in distinct_best(scores, best, settings.kept, settings.step_deg / 2)]
    step = FIRST_SHARE * settings.step_deg
    climbed = ranked([climb(coarse, turn, step, LAST_PX * coarse.pixel_deg) for turn in starts])
    climbed = distinct(climbed, settings.step_deg)[: settings.refined_kept]
    step = max(coarse.pixel_deg / 2, fine.pixel_deg)
    found = distinct(
        ranked([climb(fine, turn, step, LAST_PX * fine.pixel_deg) for _, turn in climbed]), settings.distinct_deg
    )
    evidence, turn = found[0]
    other = found[1][0] if len(found) > 1 else 0.0
    stands_out = evidence > settings.sigmas**2 and is_better(evidence, other * settings.times_next / 2)
    chosen = turn if stands_out else None
    return MapSearch(chosen, signed_root(evidence), signed_root(other), len(turns), followed)


@lru_cache(maxsize=2)
def grid_of_turns(step_deg: float) -> Array:
    """Rotations (n, 3, 3) spread evenly over all there are: points of a spiral over the sphere (Gonzalez 2010, Math.
    Geosci. 42, 49), each with every turn about itself."""
    from scipy.spatial.transform import Rotation

    step = np.radians(step_deg)
    count, rolls = int(np.ceil(4 * np.pi / step**2)), int(np.ceil(2 * np.pi / step))
    z = 1 - (2 * np.arange(count) + 1) / count
    longitude = np.pi * (3 - np.sqrt(5)) * np.arange(count)
    roll = 2 * np.pi * np.arange(rolls) / rolls
    angles = np.stack(np.broadcast_arrays(roll[:, None], np.arccos(z), longitude), axis=-1).reshape(-1, 3)
    return np.asarray(Rotation.from_euler("ZYZ", angles).as_matrix())


def grid_scores(texture: Texture, scene: Scene, turns: Array, step_deg: float) -> Array:
    """Correlation (n,) of the image's markings with the map's at each turn (n, 3, 3), both of the sizes that tell
    orientations of a grid of `step_deg` apart: finer ones no orientation of the grid may have right, and coarse ones
    many have."""
    scale = texture.shading * texture.weight
    plane = np.zeros(texture.inside.shape, np.float32)
    plane[texture.inside] = texture.value / np.maximum(scale, 1e-12)
    low, high = (share * step_deg for share in BAND_SHARES)
    value = (blurred_within(plane, texture, low) - blurred_within(plane, texture, high)) * scale
    value = value - texture.smooth @ (texture.smooth.T @ value)
    albedo = map_as_coarse_as(scene.basemap, np.radians(low / 2))
    albedo = albedo / albedo.mean()
    band = blurred_around(albedo, low) - blurred_around(albedo, high)
    arrays = (texture.points, scale, texture.smooth.T, value, band)
    edge = float(np.radians(scene.basemap.left_edge_deg))
    single = [np.ascontiguousarray(each, np.float32) for each in (*arrays, turns)]
    return np.asarray(_correlations(*single[:-1], edge, single[-1]), np.float64)


def climbed_together(texture: Texture, scene: Scene, turns: Array, step_deg: float) -> tuple[Array, Array]:
    """Turns (n, 3, 3) of the grid moved uphill by ever shorter steps about three axes, all at once, and their scores
    (n,): between the grid's orientations the right one may be a good deal higher than next to it."""
    scores = grid_scores(texture, scene, turns, step_deg)
    for share in CLIMB_SHARES:
        steps = [rotation_from_vector_deg(sign * share * step_deg * axis) for axis in np.eye(3) for sign in (1, -1)]
        trials = np.stack([turns, *(step @ turns for step in steps)])
        found = grid_scores(texture, scene, trials[1:].reshape(-1, 3, 3), step_deg).reshape(len(steps), -1)
        best = np.concatenate([scores[None], found]).argmax(axis=0)
        scores = np.concatenate([scores[None], found])[best, np.arange(len(turns))]
        turns = trials[best, np.arange(len(turns))]
    return scores, turns


def blurred_within(plane: NDArray[np.float32], texture: Texture, width_deg: float) -> Array:
    """A plane (ny, nx) blurred by a Gaussian of `width_deg` at the disk's middle, on the lit disk's n pixels alone."""
    width_px = width_deg / texture.pixel_deg
    full = np.maximum(blurred(texture.inside.astype(np.float32), width_px), 1e-3)
    return np.asarray((blurred(plane, width_px) / full)[texture.inside], np.float64)


def blurred_around(albedo: NDArray[np.float32], width_deg: float) -> NDArray[np.float32]:
    """A map (rows, columns) blurred by a Gaussian of `width_deg` of latitude, around all longitudes."""
    import cv2

    width = width_deg * albedo.shape[0] / 180
    rim = min(int(4 * width) + 1, albedo.shape[0] - 1)
    wide = cv2.copyMakeBorder(albedo, rim, rim, rim, rim, cv2.BORDER_WRAP)
    return np.asarray(cv2.GaussianBlur(wide, (0, 0), width)[rim:-rim, rim:-rim], np.float32)


@compiled_reordered
def _correlations(points, scale, smooth, value, band, left_edge, turns):  # type: ignore[no-untyped-def]
    rows, columns = band.shape
    out = np.zeros(len(turns), np.float32)
    column = np.empty(len(points), np.float32)
    own = np.float32(0)
    for i in range(len(value)):
        own += value[i] * value[i]
    for k in range(len(turns)):
        turn = turns[k]
        for i in range(len(points)):
            p = points[i]
            x = p[0] * turn[0, 0] + p[1] * turn[1, 0] + p[2] * turn[2, 0]
            y = p[0] * turn[0, 1] + p[1] * turn[1, 1] + p[2] * turn[2, 1]
            z = p[0] * turn[0, 2] + p[1] * turn[1, 2] + p[2] * turn[2, 2]
            u = (np.arctan2(y, x) - left_edge) * columns / (2 * np.pi)
            v = (0.5 * np.pi - np.arcsin(min(max(z, -1.0), 1.0))) * rows / np.pi
            column[i] = scale[i] * band[min(int(v), rows - 1), int(np.floor(u)) % columns]
        square, together = np.float32(0), np.float32(0)
        for i in range(len(points)):
            square += column[i] * column[i]
            together += column[i] * value[i]
        for j in range(len(smooth)):
            part = np.float32(0)
            for i in range(len(points)):
                part += smooth[j, i] * column[i]
            square -= part * part
        out[k] = together / np.sqrt(max(square * own, np.float32(1e-20)))
    return out


def distinct_best(scores: Array, turns: Array, count: int, apart_deg: float) -> list[int]:
    """Indices of the best of the grid, none of them next to a better one."""
    kept: list[int] = []
    for i in np.argsort(-scores)[: 20 * count]:
        if len(kept) == count:
            break
        if not kept or angles_deg(turns[kept], turns[i]).min() > 1.2 * apart_deg:
            kept.append(int(i))
    return kept


def angles_deg(turns: Array, turn: Array) -> Array:
    """Angle (n,) of the rotation between each of `turns` (n, 3, 3) and `turn` (3, 3), degrees."""
    trace = np.einsum("nij,ij->n", turns, turn)
    return np.asarray(np.degrees(np.arccos(np.clip((trace - 1) / 2, -1, 1))))


def ranked(found: list[tuple[float, Array]]) -> list[tuple[float, Array]]:
    """By evidence, the best first."""
    return sorted(found, key=lambda each: -each[0])


def distinct(found: list[tuple[float, Array]], apart_deg: float) -> list[tuple[float, Array]]:
    """Those that are no nearer than `apart_deg` to a better one."""
    kept: list[tuple[float, Array]] = []
    for each in found:
        turns = [other for _, other in kept]
        if all(np.linalg.norm(vector_deg_from_rotation(turn.T @ each[1])) > apart_deg for turn in turns):
            kept.append(each)
    return kept


def climb(texture: Texture, turn: Array, step_deg: float, last_deg: float) -> tuple[float, Array]:
    """The nearest maximum of the evidence from a turn, by ever shorter steps about three axes: evidence and turn."""
    independent = measurements(texture)
    best = evidence_of(texture.correlations(turn), independent)
    while step_deg > last_deg:
        moved = False
        for axis in np.eye(3):
            for sign in (1, -1):
                trial = rotation_from_vector_deg(sign * step_deg * axis) @ turn
                value = evidence_of(texture.correlations(trial), independent)
                if value > best:
                    best, turn, moved = value, trial, True
                    break
        if not moved:
            step_deg /= 2
    return best, turn
