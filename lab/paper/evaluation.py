"""An evaluation read back: offsets and range factors found per camera, and how the images ended."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from catalog.errors import RefusedError
from catalog.reasons import Reason
from lab.paper.section import Cell, Table

EVALUATION_FILES = ("evaluate.json", "evaluation.json")


def statistics(values: Sequence[float]) -> dict[str, float]:
    """Count, mean, smallest, largest."""
    known = np.array(values, float)
    return {"images": len(known), "mean": float(known.mean()), "min": float(known.min()), "max": float(known.max())}


def read_evaluation(folder: Path) -> dict[str, list[dict[str, Any]]]:
    """images and summary of an evaluation (see `lab.evaluate.summary`; [] where there is none). Raises RefusedError
    when the folder holds no evaluation."""
    path = next((folder / name for name in EVALUATION_FILES if (folder / name).is_file()), None)
    remedy = "Give the folder that `planetpose evaluate --out` wrote."
    if path is None:
        raise RefusedError(Reason.EVALUATION_MISSING, f"{folder} holds no {EVALUATION_FILES[0]}.", remedy)
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        return {"images": content["images"], "summary": content.get("summary", [])}
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise RefusedError(Reason.EVALUATION_UNREADABLE, f"{path} is no evaluation ({error!r}).", remedy) from error


def by_profile(rows: Sequence[Mapping[str, Any]]) -> dict[str, list[Mapping[str, Any]]]:
    """Images with a pose before and after, by profile."""
    whole = [row for row in rows if row.get("before") and row.get("after")]
    return {p: [row for row in whole if row["profile"] == p] for p in dict.fromkeys(row["profile"] for row in whole)}


Found = dict[str, dict[str, np.ndarray]]


def offsets(rows: Sequence[Mapping[str, Any]]) -> Found:
    """Per camera: found_px (n, 2) corrected minus predicted centre; error_px (n, 2) what is left of it; factor (n,)
    found range factor; factor_error (n,)."""
    found: Found = {}
    for camera in dict.fromkeys(str(row["camera"]) for row in rows):
        own = [row for row in rows if row["camera"] == camera]
        before, after = (np.array([row[when]["centre_px"] for row in own], float) for when in ("before", "after"))
        ranges = [np.array([row[when]["range_error"] for row in own], float) for when in ("before", "after")]
        found[camera] = {
            "found_px": after - before,
            "error_px": after,
            "factor": (1 + ranges[1]) / (1 + ranges[0]),
            "factor_error": ranges[1],
        }
    return found


def camera_entry(own: dict[str, np.ndarray]) -> dict[str, Any]:
    """One camera of an evaluation in paper.json."""
    error = np.hypot(*own["error_px"].T)
    return {
        "found_px": {name: statistics(values) for name, values in lengths(own["found_px"]).items()},
        "centre_error_px": statistics(error.tolist()) | {"median": float(np.median(error))},
        "range_factor": statistics(own["factor"].tolist()),
        "range_error": {"median": float(np.median(np.abs(own["factor_error"]))),
                        "max": float(np.abs(own["factor_error"]).max())},
    }  # fmt: skip


def lengths(pairs: np.ndarray) -> dict[str, list[float]]:
    """Length, |x| and |y| of offsets (n, 2)."""
    return {"length": np.hypot(*pairs.T).tolist(), "x": np.abs(pairs[:, 0]).tolist(), "y": np.abs(pairs[:, 1]).tolist()}


def evaluation_table(profile: str, found: Found) -> Table:
    """What an evaluation found, and what error it left, per camera."""
    header = ("camera", "images", "found offset mean", "min", "max", "|x| mean", "|y| mean", "left: median",
              "left: largest", "range factor min", "max", "range error, median 1e-4")  # fmt: skip
    rows: list[list[Cell]] = []
    for camera, own in found.items():
        entry = camera_entry(own)
        length, left = entry["found_px"]["length"], entry["centre_error_px"]
        rows.append([
            camera, length["images"], length["mean"], length["min"], length["max"], entry["found_px"]["x"]["mean"],
            entry["found_px"]["y"]["mean"], left["median"], left["max"], f"{entry['range_factor']['min']:.4f}",
            f"{entry['range_factor']['max']:.4f}", 1e4 * entry["range_error"]["median"],
        ])  # fmt: skip
    return Table(f"Evaluation, profile {profile}: offsets found and what is left of them, pixels", header, rows)


def verdict_table(summary: Sequence[Mapping[str, Any]]) -> Table:
    """How the images of an evaluation ended, and the errors of those that were published."""
    header = ("profile", "camera", "images", "ok", "doubtful", "refused", "failed", "silently wrong",
              "centre, px: median", "90 %", "largest", "attitude across sight, deg", "about sight", "surface, px",
              "s")  # fmt: skip
    rows: list[list[Cell]] = []
    for each in summary:
        after = each["after"]

        def value(kind: str, which: str = "median", after: Mapping[str, Any] = after) -> float | None:
            return after[kind][which] if after.get(kind) else None

        counts = [each[key] for key in ("images", "ok", "doubtful", "refused", "failed", "silently_wrong")]
        centre = [value("centre_error_px", which) for which in ("median", "p90", "largest")]
        turns = [value("across_sight_deg"), value("about_sight_deg"), value("surface_px")]
        rows.append([each["profile"], each["camera"], *counts, *centre, *turns, each["seconds"]])
    return Table(
        "Evaluation: how the images ended (silently wrong: ok, but the centre more than 3 px off)", header, rows
    )
