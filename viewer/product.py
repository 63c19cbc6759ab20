"""What the page shows of one product beside its planes: curves, verdict, poses, decisions."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from catalog.errors import RefusedError
from catalog.plain_files import own_json
from catalog.pose import Pose
from catalog.regular_file import read_regular_text
from tasks.guidance.decisions import decisions_of
from tasks.project.curves import Curve, graticule, limb, terminator
from tasks.publish.contained import refuse_what_is_elsewhere
from tasks.publish.cube_model import CubeModel, model_of
from tasks.publish.names import RESULT
from tasks.publish.overlay import GRID_STEP_DEG, grid_labels
from viewer.planes import TILE_PX, Planes, levels_of

DIGITS = 3
SHOWN_RESULT = (
    "status", "reason", "warnings", "utc", "camera", "target", "profile", "pose_source", "guidance", "centre_px",
    "offset_px", "range_factor", "range_factor_free", "attitude_deg", "roll_deg", "psf_sigma_px", "uncertainty",
    "orientation", "limb_rms_px", "limb_points", "limb_robust_px", "limb_disagreeing", "similarity", "seconds", "image",
)  # fmt: skip


def product_page(planes: Planes, product: str) -> dict[str, Any]:
    """Plain JSON. Raises RefusedError when the product is gone or damaged."""
    cube = planes.cube(product)
    model = model_of(cube)
    before = CubeModel(Pose.from_dict(own_json(cube.attrs["pose_before"])), model.camera, model.target, model.detector)
    ny, nx = cube["image"].shape
    quality = cube["quality"].attrs
    flags = [
        {"name": name, "mask": int(mask)}
        for mask, name in zip(quality["flag_masks"], str(quality["flag_meanings"]).split(), strict=True)
    ]
    return {
        "product": product,
        "size_px": [int(nx), int(ny)],
        "first_px": [int(cube[name][0]) for name in ("x", "y")],
        "tile_px": TILE_PX,
        "levels": levels_of((int(ny), int(nx))),
        "planes": planes.names(product),
        "flags": flags,
        "radii_km": list(model.target.radii_km),
        "pixel_space": cube.attrs.get("pixel_space"),
        "range_km": model.pose.range_km,
        "focal_length_px": model.camera.focal_length_px,
        "centre_px": _points(model, model.camera.project(model.pose.target_in_camera_km)[None])[0],
        "predicted_centre_px": _points(before, before.camera.project(before.pose.target_in_camera_km)[None])[0],
        "curves": {"after": curves_of(model), "before": curves_of(before, with_grid=False)},
        "result": shown_result(planes.store / product),
        "decisions": [decision.__dict__ for decision in decisions_of(planes.store, product)],
    }


def curves_of(model: CubeModel, with_grid: bool = True) -> dict[str, Any]:
    """Limb, terminator, and grid with labels, in pixels of the image; null interrupts a line."""
    pose, camera, target = model.pose, model.camera, model.target
    outline = limb(pose, camera, target)
    found: dict[str, Any] = {
        "limb": _points(model, np.vstack([outline.xy_px, outline.xy_px[:1]])),
        "lit": [bool(lit) for lit in outline.illuminated],
    }
    if not with_grid:
        return found
    lines = graticule(pose, camera, target, GRID_STEP_DEG)
    found["terminator"] = _line(model, terminator(pose, camera, target))
    found["grid"] = [_line(model, line) for line in lines]
    labels = grid_labels(lines, pose, target)
    places = _points(model, np.array([xy for _, xy, _ in labels]).reshape(-1, 2))
    found["labels"] = [{"text": text, "xy": place} for (text, _, _), place in zip(labels, places, strict=True) if place]
    return found


def _line(model: CubeModel, curve: Curve) -> list[list[float] | None]:
    return _points(model, curve.visible_xy_px)


def _points(model: CubeModel, xy: Any) -> list[list[float] | None]:
    places = model.pixels_of(np.asarray(xy, dtype=np.float64))
    known = np.asarray(np.isfinite(places).all(axis=-1))
    rounded = np.round(np.where(known[:, None], places, 0.0), DIGITS).tolist()
    return [place if there else None for place, there in zip(rounded, known, strict=True)]


def shown_result(folder: Path) -> dict[str, Any]:
    """What the product's result says, as far as the page shows it; nothing where there is none."""
    try:
        refuse_what_is_elsewhere(folder)
        content = own_json(read_regular_text(folder / RESULT))
    except (OSError, ValueError, RefusedError):
        return {}
    found = {name: content.get(name) for name in SHOWN_RESULT} if isinstance(content, dict) else {}
    return dict(json.loads(json.dumps(found)))
