"""Match close-ups with known truth to the catalog's maps, and to maps and places that are not theirs."""

import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np

from catalog.basemap import BaseMap
from catalog.errors import PlanetposeError
from catalog.pose import Pose
from catalog.target import Target
from lab.closeup.scene import CloseUp, close_up, photographed
from lab.closeup.surface import catalog_texture, true_texture
from tasks.closeup import CloseUpSettings, find_close_up
from tasks.closeup.level import samples
from tasks.priors import PriorSettings
from tasks.project.points import body_points, pixels_of_points
from tasks.simulate import Scene

Row = dict[str, Any]

# Of the planted errors; a pose file's priors are wider, a kernel's range is better known.
PRIORS = PriorSettings(range_km=None, range_share=0.002, roll_deg=0.6, attitude_deg=0.1)
DECOYS = ("mirrored", "upside down", "other place", "other body")
BAR_MAP_PX, FAR_SIGMAS = 0.5, 3.0


def run_close_ups(seeds: Iterable[int], decoys: int, maps: Path | None, tell: Callable[[Row], None]) -> list[Row]:
    """Rows of the frames of these seeds, and of `decoys` wrong maps for each of them."""
    rows = []
    for seed in seeds:
        scene = close_up(seed)
        name = scene.target.name.lower()
        observation = photographed(scene, true_texture(name, seed, maps))
        right = BaseMap("catalog", catalog_texture(name), 0.0, "catalog")
        kinds = [("right", right), *((kind, decoy(kind, name, seed)) for kind in chosen(seed, decoys))]
        for kind, basemap in kinds:
            started = time.process_time()
            row = {"seed": seed, "kind": kind, "camera": scene.camera.name, "target": name, "law": scene.law}
            row |= {"span_radii": scene.span_radii, "offset_px": scene.offset_px}
            row |= corrected(scene, observation, basemap) | {"cpu_s": time.process_time() - started}
            rows.append(row)
            tell(row)
    return rows


def chosen(seed: int, decoys: int) -> list[str]:
    """Kinds of the wrong maps of a frame, in turn."""
    return [DECOYS[(seed * decoys + number) % len(DECOYS)] for number in range(decoys)]


def decoy(kind: str, name: str, seed: int) -> BaseMap:
    """A map of which nothing is where the frame looks."""
    random = np.random.default_rng([76, seed])
    albedo, left = catalog_texture(name), float(random.uniform(40.0, 320.0))
    if kind == "mirrored":
        albedo = albedo[:, ::-1]
    elif kind == "upside down":
        albedo = albedo[::-1]
    elif kind == "other body":
        albedo = catalog_texture("moon" if name != "moon" and seed % 2 else "mercury")
    return BaseMap(kind, np.ascontiguousarray(albedo), left, kind)


def corrected(scene: CloseUp, observation: Any, basemap: BaseMap) -> Row:
    """Status, reason, false-alarm probability and, where there is a pose, its error."""
    pose = scene.predicted
    try:
        found = find_close_up(
            observation, pose, pose, Scene(scene.camera, scene.target, basemap), CloseUpSettings(), PRIORS
        )
    except PlanetposeError as error:
        return {"status": "not found", "reason": error.code}
    figures = found.evidence["patches"]
    error_px = place_error_px(scene.true, found.pose, scene.camera, scene.target)
    doubt = found.evidence.get("doubt")
    return {
        "status": "doubtful" if doubt else "ok",
        "reason": doubt,
        "error_px": error_px,
        "error_map_px": error_px / figures["map_pixel_px"],
        **{key: value for key, value in figures.items() if not isinstance(value, list)},
    }


def place_error_px(true: Pose, found: Pose, camera: Any, target: Target) -> float:
    """How far from where it is the found pose has what the frame shows, px, RMS over the frame."""
    xy = samples(Scene(camera, target, BaseMap("none", np.ones((2, 4), np.float32), 0.0, "none")))
    off = pixels_of_points(found, camera, body_points(true, camera, target, xy)) - xy
    return float(np.sqrt(np.nanmean(np.sum(off**2, axis=-1))))


def summary(rows: list[Row]) -> Row:
    """The figures: of the right maps how many are ok and how near, of the wrong ones how many are found at all."""
    right, wrong = ([row for row in rows if (row["kind"] == "right") == is_right] for is_right in (True, False))
    ok = [row for row in right if row["status"] == "ok"]
    errors = np.array([row["error_map_px"] for row in ok])
    solved = [row for row in ok if row["error_map_px"] <= BAR_MAP_PX]
    alarms = np.array([row.get("false_alarm", 1.0) for row in wrong])
    return {
        "frames": len(right),
        "ok": len(ok),
        "solved": len(solved),
        "ok_far_off": sorted(row["seed"] for row in ok if in_sigmas(row) > FAR_SIGMAS),
        "doubtful": sum(row["status"] == "doubtful" for row in right),
        "not_found": sum(row["status"] == "not found" for row in right),
        "error_map_px": {} if not ok else quantiles(errors),
        "error_in_sigmas": {} if not ok else quantiles(np.array([in_sigmas(row) for row in ok])),
        "wrong_maps": len(wrong),
        "wrong_ok": sum(row["status"] == "ok" for row in wrong),
        "wrong_doubtful": sum(row["status"] == "doubtful" for row in wrong),
        "wrong_below": {f"{limit:g}": int(np.count_nonzero(alarms < limit)) for limit in (1e-2, 1e-3, 1e-4)},
        "cpu_s_median": float(np.median([row["cpu_s"] for row in right])),
        "groups": {group: of_group(right, group) for group in sorted({row["target"] for row in right})},
    }


def in_sigmas(row: Row) -> float:
    """Error of a place, in its stated sigma: that of two axes."""
    return float(row["error_map_px"] / (2**0.5 * row["sigma_map_px"]))


def quantiles(values: Any) -> Row:
    """Median, 95 % and largest."""
    return {"median": float(np.median(values)), "95%": float(np.quantile(values, 0.95)), "worst": float(max(values))}


def of_group(rows: list[Row], target: str) -> Row:
    """Frames of a target, how many are ok and within the bar."""
    mine = [row for row in rows if row["target"] == target]
    solved = [row for row in mine if row["status"] == "ok" and row["error_map_px"] <= BAR_MAP_PX]
    return {"frames": len(mine), "solved": len(solved)}
