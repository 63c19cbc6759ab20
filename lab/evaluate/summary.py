"""Figures of an evaluation: distributions of errors per profile, camera and step. Plain functions of its rows."""

from collections import Counter
from collections.abc import Iterable
from typing import Any

import numpy as np

Row = dict[str, Any]
ALL = "all"
WRONG_PX = 3.0
STATUSES = ("ok", "doubtful", "refused", "failed")
ERRORS = ("centre_error_px", "range_error", "about_sight_deg", "across_sight_deg", "surface_px")
LIMITS = (1.0, 2.0)


def summary_of(rows: list[Row]) -> list[dict[str, Any]]:
    """One entry for each profile and camera, and for each profile and all its cameras together (camera `all`)."""
    groups = []
    for profile in dict.fromkeys(row["profile"] for row in rows):
        own = [row for row in rows if row["profile"] == profile]
        cameras = sorted({row["camera"] for row in own})
        groups += [(profile, camera, [row for row in own if row["camera"] == camera]) for camera in cameras]
        groups.append((profile, ALL, own))
    return [{"profile": profile, "camera": camera, **group_figures(group)} for profile, camera, group in groups]


def group_figures(rows: list[Row]) -> dict[str, Any]:
    """Counts by status; reasons; silently_wrong: ok, but the centre is more than `WRONG_PX` off; before, after:
    distributions of the errors' sizes, after over the published poses; steps: the same after each step; sigmas:
    fractions of components within 1 and 2 of their stated uncertainty; seconds per image and per step, median."""
    statuses = Counter(row["status"] for row in rows)
    published = [row["after"] for row in rows if row["after"]]
    return {
        "images": len(rows),
        **{status: statuses[status] for status in STATUSES},
        "reasons": dict(Counter(row["code"] for row in rows if row["code"])),
        "silently_wrong": sum(is_silently_wrong(row) for row in rows),
        "before": distributions([row["before"] for row in rows if row["before"]]),
        "after": distributions(published),
        "steps": _steps(rows),
        "sigmas": {kind: _within(rows, kind) for kind in ("centre_px", "range_factor", "attitude_deg")},
        "seconds": _median([sum(row["seconds"].values()) for row in rows]),
        "seconds_of_steps": {
            step: _median([row["seconds"][step] for row in rows if step in row["seconds"]])
            for step in dict.fromkeys(step for row in rows for step in row["seconds"])
        },
    }


def is_silently_wrong(row: Row) -> bool:
    """Whether the result claims to be right and is not."""
    return row["status"] == "ok" and row["after"] is not None and row["after"]["centre_error_px"] > WRONG_PX


def distributions(errors: list[dict[str, Any]]) -> dict[str, Any]:
    """Distribution of the sizes of each kind of error; None when there is no image."""
    return {kind: distribution([abs(error[kind]) for error in errors]) for kind in ERRORS}


def distribution(values: Iterable[float]) -> dict[str, float] | None:
    """Median, mean, 90th percentile and largest value; None for no values."""
    array = np.asarray(list(values), dtype=np.float64)
    if array.size == 0:
        return None
    return {
        "median": float(np.median(array)),
        "mean": float(array.mean()),
        "p90": float(np.percentile(array, 90)),
        "largest": float(array.max()),
    }


def _steps(rows: list[Row]) -> dict[str, Any]:
    names = dict.fromkeys(name for row in rows for name in row["steps"])
    reached = {name: [row["steps"][name] for row in rows if name in row["steps"]] for name in names}
    return {name: {"images": len(errors), **distributions(errors)} for name, errors in reached.items()}


def _within(rows: list[Row], kind: str) -> dict[str, float] | None:
    ratios = [ratio for row in rows if row["sigmas"] for ratio in row["sigmas"][kind] or ()]
    if not ratios:
        return None
    sizes = np.abs(ratios)
    return {"components": len(ratios), **{f"within_{limit:.0f}": float((sizes < limit).mean()) for limit in LIMITS}}


def _median(values: list[float]) -> float | None:
    return float(np.median(values)) if values else None
