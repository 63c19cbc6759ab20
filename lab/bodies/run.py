"""Correct scenes of several bodies and compare with the truth."""

import json
import shutil
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from catalog.target import find_target
from lab.bodies.picture import truth_of, write_scene
from lab.bodies.scenes import KINDS, Scene, scene_of
from lab.rows import rows_in_portions

Row = dict[str, Any]
# An `ok` is wrong where its centre is off by more than this, and by more than so many of its stated sigmas.
BAR_PX, WRONG_SIGMAS = 0.1, 3.0
LARGE_PX = 40.0  # width of a sunlit disk from which on the bar counts
# Shadows are compared as lit, partly and not lit: the counted truth tells fractions to about 0.02.
LIT, DARK = 0.02, 0.98


def numbered(count: int, kinds: Sequence[str] = ()) -> list[tuple[str, int]]:
    """Kinds and numbers (`scene_of`) of `count` scenes, the kinds by turns."""
    names = [kind for kind in KINDS if not kinds or kind in kinds]
    return [(names[number % len(names)], number // len(names)) for number in range(count)]


def run_scene(scene: Scene, with_bodies: bool = True, keep: Path | None = None) -> Row:
    """Correct a scene from its files. with_bodies: as the pose file has them; without, as if nobody knew them."""
    from flows.one_image import one_result
    from flows.progress import Silent
    from flows.request import Request
    from tasks.publish.cube import open_cube
    from tasks.step import run

    folder = keep or Path(tempfile.mkdtemp(prefix="bodies-"))
    try:
        files = write_scene(scene, folder)
        if not with_bodies:
            content = json.loads(files.pose.read_text())
            files.pose.write_text(json.dumps({key: value for key, value in content.items() if key != "bodies"}))
        request = Request(
            image=files.image, camera=str(files.camera), target=scene.target, pose_file=files.pose, kernels=(),
            store=folder / "out", cache=folder / "cache",
        )  # fmt: skip
        begun = time.perf_counter()
        result = one_result(request, Silent(), run_step=run)
        row: Row = {"id": scene.id, "kind": scene.kind, "status": result["status"], "reason": result["reason"]}
        row["lit_px"] = lit_px_of(scene)
        row["seconds"] = round(time.perf_counter() - begun, 2)
        row["roll_by"] = result["roll_by"]
        row["centre_error_px"] = row["body_wrong"] = row["shadow_wrong"] = None
        if result.get("centre_px"):
            off = np.array(result["centre_px"]) - scene.centre_px
            row["centre_error_px"] = float(np.hypot(*off))
            row["sigmas"] = float(np.max(np.abs(off) / result["uncertainty"]["centre_px"]))
            with open_cube(folder / "out" / scene.id / "cube.zarr") as cube:
                row |= flags_wrong(cube, scene)
        return row
    finally:
        if keep is None:
            shutil.rmtree(folder, ignore_errors=True)


def lit_px_of(scene: Scene) -> float:
    """Width of the sunlit part of the target's whole disk."""
    range_km, sun = float(np.linalg.norm(scene.target_km)), scene.sun_km / np.linalg.norm(scene.sun_km)
    radius_px = scene.lens.focal_px * find_target(scene.target).mean_radius_km / range_km
    return float(radius_px * (1 - sun @ scene.target_km / range_km))


def flags_wrong(cube: Any, scene: Scene) -> Row:
    """Shares of the frame's pixels whose body or shadow is not the true one."""
    truth = truth_of(scene)
    if "body_id" not in cube:
        return {}
    body_id, shadow = cube["body_id"].values, cube["shadow"].values
    same = (body_id == truth["body_id"]) & (body_id != 0)
    classes = [np.digitize(each[same], [LIT, DARK]) for each in (shadow, truth["shadow"])]
    return {
        "body_wrong": float(np.mean(body_id != truth["body_id"])),
        "shadow_wrong": float(np.count_nonzero(np.abs(classes[0] - classes[1]) > 0) / body_id.size),
    }


def run_scenes(
    scenes: Sequence[tuple[str, int]],
    report: Callable[[Row], None] = lambda _: None,
    path: Path | None = None,
    minutes: float | None = None,
) -> list[Row]:
    """Rows of the scenes of these kinds and numbers, one after the other (see `rows_in_portions`)."""
    rows = []
    for row, new in rows_in_portions(
        scenes, lambda one: f"{one[0]}-{one[1]:03d}", lambda one: run_scene(scene_of(*one)), path, minutes
    ):
        rows.append(row)
        if new:
            report(row)
    return rows


def summary_of(rows: Sequence[Row]) -> dict[str, Any]:
    """The figures that the bars are about, of all scenes and by kind."""
    kinds = sorted({row["kind"] for row in rows})
    by_kind = {kind: figures_of([row for row in rows if row["kind"] == kind]) for kind in kinds}
    return figures_of(rows) | {"by_kind": by_kind}


def figures_of(rows: Sequence[Row]) -> dict[str, Any]:
    """Of some scenes. large_beyond_bar: `ok` ones of a wide sunlit disk that are off by more than the bar."""
    sound = [row for row in rows if row["status"] == "ok" and row["centre_error_px"] is not None]
    errors = [row["centre_error_px"] for row in sound]
    wrong = {
        name: [row[f"{name}_wrong"] for row in rows if row.get(f"{name}_wrong") is not None]
        for name in ("body", "shadow")
    }
    right = {name: float(1 - np.mean(shares)) if shares else None for name, shares in wrong.items()}
    return {
        "scenes": len(rows),
        "ok": sum(row["status"] == "ok" for row in rows),
        "wrong_ok": sum(row["centre_error_px"] > BAR_PX and row["sigmas"] > WRONG_SIGMAS for row in sound),
        "ok_beyond_bar": sum(error > BAR_PX for error in errors),
        "large_beyond_bar": sum(row["centre_error_px"] > BAR_PX and row.get("lit_px", 0) > LARGE_PX for row in sound),
        "share_ok": float(np.mean([row["status"] == "ok" for row in rows])) if rows else 0.0,
        "centre_median_px": float(np.median(errors)) if errors else None,
        "centre_worst_px": max(errors, default=None),
        "sigmas_worst": max((row["sigmas"] for row in sound), default=None),
        "body_right": right["body"],
        "shadow_right": right["shadow"],
    }
