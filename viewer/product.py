"""What the page shows of one product beside its planes: curves, verdict, poses, decisions."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np

from catalog.errors import RefusedError
from catalog.plain_files import own_json
from catalog.pose import Pose
from catalog.reasons import Reason
from catalog.regular_file import read_regular_text
from tasks.diagnose.failed_folder import failed_result, tried_explanations
from tasks.guidance.decisions import decisions_of
from tasks.guidance.prefect_run import noted_run
from tasks.project.curves import graticule, limb, terminator
from tasks.publish.contained import refuse_what_is_elsewhere
from tasks.publish.cube_model import CubeModel, model_of
from tasks.publish.names import RESULT
from tasks.publish.overlay import GRID_STEP_DEG, grid_labels
from viewer.layers import others_of, places_on, stars_of
from viewer.planes import Planes, levels_of

CODE = re.compile(r"(?:^|(?<=\s))([a-z][a-z0-9-]+)(?=: )")
KNOWN_CODES = frozenset(Reason)
SHOWN_RESULT = (
    "status", "reason", "warnings", "utc", "camera", "target", "profile", "pose_source", "guidance", "centre_px",
    "offset_px", "range_factor", "range_factor_free", "attitude_deg", "roll_deg", "psf_sigma_px", "uncertainty",
    "roll_by", "orientation", "limb_rms_px", "limb_points", "limb_robust_px", "limb_disagreeing", "similarity",
    "seconds", "image", "patches",
)  # fmt: skip


def product_page(planes: Planes, product: str) -> dict[str, Any]:
    """Plain JSON. Raises RefusedError when the product is gone or damaged."""
    cube = planes.cube(product)
    model = model_of(cube)
    before = CubeModel(Pose.from_dict(own_json(cube.attrs["pose_before"])), model.camera, model.target, model.detector)
    ny, nx = cube["image"].shape
    failure = of_failure(planes, product)
    stated = failure.pop("result", None) or stated_result(planes.store / product)
    quality = cube["quality"].attrs
    flags = [
        {"name": name, "mask": int(mask)}
        for mask, name in zip(quality["flag_masks"], str(quality["flag_meanings"]).split(), strict=True)
    ]
    return {
        "product": product,
        "size_px": [int(nx), int(ny)],
        "first_px": [int(cube[name][0]) for name in ("x", "y")],
        "tile_px": planes.tile_px,
        "levels": levels_of((int(ny), int(nx)), planes.tile_px),
        "planes": planes.names(product),
        "flags": flags,
        "radii_km": list(model.target.radii_km),
        "pixel_space": cube.attrs.get("pixel_space"),
        "range_km": model.pose.range_km,
        "focal_length_px": model.camera.focal_length_px,
        "centre_px": places_on(model, model.camera.project(model.pose.target_in_camera_km)[None])[0],
        "predicted_centre_px": places_on(before, before.camera.project(before.pose.target_in_camera_km)[None])[0],
        "curves": {"after": curves_of(model), "before": curves_of(before, with_grid=False)},
        "others": others_of(model, stated.get("bodies")),
        "stars": stars_of(model, stated.get("stars")),
        "result": shown(stated),
        **papers(planes.store, product),
        **failure,
    }


def papers(store: Path, product: str) -> dict[str, Any]:
    """What there is also without a picture: decisions, and the Prefect run that did the image last."""
    decisions = [decision.__dict__ for decision in decisions_of(store, product)]
    return {"product": product, "decisions": decisions, "run": noted_run(store, product)}


def advice_of(reason: str | None) -> list[dict[str, str]]:
    """What the codes in a reason mean and what to do, in their order; plugins' own codes have no text."""
    codes = [code for code in CODE.findall(reason or "") if code in KNOWN_CODES]
    texts = {code: Reason(code).text for code in codes}
    return [{"code": code, "meaning": text.meaning, "remedy": text.remedy} for code, text in texts.items()]


def of_failure(planes: Planes, product: str) -> dict[str, Any]:
    """The result of a failed image and what was tried to explain it; of a product that is older than a failure only
    that failure's reason, as `failed_later`."""
    failure = failed_result(planes.store, product)
    if not failure:
        return {}
    if planes.has_product(product):
        return {"failed_later": failure.get("reason")}
    return {"failed": True, "result": failure, "tried": tried_explanations(planes.store, product)}


def curves_of(model: CubeModel, with_grid: bool = True) -> dict[str, Any]:
    """Limb, terminator, and grid with labels, in pixels of the image; null interrupts a line."""
    pose, camera, target = model.pose, model.camera, model.target
    outline = limb(pose, camera, target)
    found: dict[str, Any] = {
        "limb": places_on(model, np.vstack([outline.xy_px, outline.xy_px[:1]])),
        "lit": [bool(lit) for lit in outline.illuminated],
    }
    if not with_grid:
        return found
    lines = graticule(pose, camera, target, GRID_STEP_DEG)
    found["terminator"] = places_on(model, terminator(pose, camera, target).visible_xy_px)
    found["grid"] = [places_on(model, line.visible_xy_px) for line in lines]
    labels = grid_labels(lines, pose, target)
    places = places_on(model, np.array([xy for _, xy, _ in labels]).reshape(-1, 2))
    found["labels"] = [{"text": text, "xy": place} for (text, _, _), place in zip(labels, places, strict=True) if place]
    return found


def stated_result(folder: Path) -> dict[str, Any]:
    """The product's result; empty where there is none, or it cannot be read."""
    try:
        refuse_what_is_elsewhere(folder)
        content = own_json(read_regular_text(folder / RESULT))
    except (OSError, ValueError, RefusedError):
        return {}
    return content if isinstance(content, dict) else {}


def shown(result: dict[str, Any]) -> dict[str, Any]:
    """What of a result the page shows."""
    return dict(json.loads(json.dumps({name: result.get(name) for name in SHOWN_RESULT})))
