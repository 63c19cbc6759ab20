"""The benchmark's figures: verdicts, violations, and how many errors lie within their stated sigmas."""

from collections import Counter
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from lab.honesty.assess import assess, violations

Row = dict[str, Any]
STATUSES = ("ok", "doubtful", "failed", "refused")
QUANTITIES = {"centre": "centre_px", "range": "range", "across": "across_deg", "roll": "roll_deg"}
OK_SHARE, WITHIN_1, WITHIN_2 = 0.92, (0.60, 0.76), 0.93


def summary(rows: list[Row]) -> Row:
    """Figures of all rows, plain JSON. calibration is of the solvable scenes that are `ok`: shares of components within
    1 and 2 stated sigmas, of all, per law, class of radius and kind of metadata. not_ok: solvable scenes that are not
    `ok`. bars: whether each of the benchmark's bars holds."""
    assessed = [(row, assess(row)) for row in rows]
    wrong = [entry | {"planted": planted(row)} for row, errors in assessed for entry in violations(row, errors)]
    solvable = [row for row in rows if row["scene"]["solvable"]]
    ok = [pair for pair in assessed if pair[0]["scene"]["solvable"] and pair[0]["result"]["status"] == "ok"]
    calibration = {
        "all": {"all": within(ok)},
        "law": by(ok, lambda row: row["scene"]["law"]),
        "radius": by(ok, lambda row: row["scene"]["size_class"]),
        "metadata": by(ok, lambda row: row["scene"]["metadata"]),
    }
    ok_share = len(ok) / len(solvable) if solvable else None
    cpu = [sum(row["cpu_s"].values()) for row in rows]
    return {
        "scenes": len(rows),
        "statuses": dict(Counter(row["result"]["status"] for row in rows)),
        "solvable": len(solvable),
        "solvable_ok": len(ok),
        "solvable_ok_by_metadata": {
            kind: [
                sum(pair[0]["scene"]["metadata"] == kind for pair in ok),
                sum(r["scene"]["metadata"] == kind for r in solvable),
            ]
            for kind in ("good", "rough")
        },
        "not_ok": [
            {
                "id": row["id"],
                "status": row["result"]["status"],
                "reason": row["result"]["reason"],
                "planted": planted(row),
            }
            for row in solvable
            if row["result"]["status"] != "ok"
        ],
        "groups": {name: group_figures(group) for name, group in grouped(assessed).items()},
        "violations": wrong,
        "calibration": calibration,
        "bars": {
            "no_wrong_ok": not wrong,
            "solvable_ok": ok_share is not None and ok_share >= OK_SHARE,
            "calibrated": all(
                is_calibrated(figures) for kind in ("all", "law", "radius") for figures in calibration[kind].values()
            ),
        },
        "cpu_s": {
            "render": sum(row["cpu_s"]["render"] for row in rows),
            "correct": sum(row["cpu_s"]["correct"] for row in rows),
            "median": float(np.median(cpu)) if cpu else None,
        },
    }


def grouped(assessed: list[tuple[Row, Row | None]]) -> dict[str, list[tuple[Row, Row | None]]]:
    """By group, in the order of appearance."""
    groups: dict[str, list[tuple[Row, Row | None]]] = {}
    for pair in assessed:
        groups.setdefault(pair[0]["scene"]["group"], []).append(pair)
    return dict(sorted(groups.items()))


def group_figures(pairs: list[tuple[Row, Row | None]]) -> Row:
    """Counts of a group; medians over its `ok`s."""
    statuses = Counter(row["result"]["status"] for row, _ in pairs)
    ok = [errors for row, errors in pairs if row["result"]["status"] == "ok" and errors]
    solvable = [row for row, _ in pairs if row["scene"]["solvable"]]
    stated = [errors["centre_px"] for errors in ok if errors["centre_px"]["sigma"]]
    return {
        "scenes": len(pairs),
        **{status: statuses[status] for status in STATUSES},
        "solvable": len(solvable),
        "solvable_ok": sum(row["result"]["status"] == "ok" for row in solvable),
        "violations": sum(len(violations(row, errors)) for row, errors in pairs),
        "centre_px": median(errors["centre_px"]["size"] for errors in ok),
        "centre_sigma_px": median(float(np.mean(each["sigma"])) for each in stated),
        "limb_px": median(abs(errors["range"]["limb_px"]) for errors in ok),
        "cpu_s": median(row["cpu_s"]["correct"] for row, _ in pairs),
    }


def by(pairs: list[tuple[Row, Row | None]], key: Callable[[Row], str]) -> Row:
    """`within` of each class."""
    names = sorted({key(row) for row, _ in pairs})
    return {name: within([pair for pair in pairs if key(pair[0]) == name]) for name in names}


def within(pairs: list[tuple[Row, Row | None]]) -> Row:
    """For each quantity: components, shares within 1 and 2 sigmas, rms z and mean z; None without any. An orientation
    that stays as predicted is no result: its sigma is that of the metadata."""
    figures: Row = {"scenes": len(pairs)}
    for name, key in QUANTITIES.items():
        errors = [errors[key] for row, errors in pairs if errors and is_result(row, errors[key])]
        z = np.array([value for error in errors for value in error["z"] or ()])
        figures[name] = None
        if z.size:
            figures[name] = {
                "components": int(z.size),
                "within_1": float((np.abs(z) < 1).mean()),
                "within_2": float((np.abs(z) < 2).mean()),
                "rms": float(np.sqrt((z**2).mean())),
                "mean": float(z.mean()),
            }
    return figures


def is_result(row: Row, error: Row) -> bool:
    """Whether the image determines what an error is of, and the result states its sigma."""
    return "stated" not in error or (error["stated"] and row["result"]["attitude_deg"] is not None)


def is_calibrated(figures: Row) -> bool:
    """Whether the shares of a class lie where they should."""
    known = [figures[name] for name in QUANTITIES if figures[name]]
    return all(WITHIN_1[0] <= each["within_1"] <= WITHIN_1[1] and each["within_2"] >= WITHIN_2 for each in known)


def planted(row: Row) -> str:
    """What was planted, in a few words."""
    scene, errors = row["scene"], row["truth"]["planted"]
    words = [
        f"{scene['target']}" + (f" named {scene['reported']}" if scene["reported"] else ""),
        f"r {scene['radius_px']:.0f} px, phase {scene['phase_deg']:.0f}, {law_of(scene)}, {scene['lens']}",
        f"offset {np.hypot(*errors['offset_px']):.0f} px, range {100 * (errors['range_factor'] - 1):+.1f} %, "
        f"attitude {np.linalg.norm(errors['attitude_deg']):.1f} deg",
    ]
    special = {
        "sun_off_deg": "Sun off {:.0f} deg",
        "smear_px": "smear {:.1f} px",
        "blur_px": "blur {:.1f} px",
        "distortion_px": "distortion {:.1f} px",
        "focal_error": "focal length {:+.4f}",
        "relief": "relief {:.3f}",
        "late_deg": "time late by {:.1f} deg",
        "moffat": "Moffat {:.1f}",
    }
    words += [text.format(scene[name]) for name, text in special.items() if scene[name]]
    words += [f"{scene['fault']} {scene['fault_size']:g}"] if scene.get("fault") else []
    words += [f"radii x {tuple(scene['radii'])}"] if set(scene.get("radii", (1,))) != {1} else []
    words += [f"map contrast {scene['map_contrast']:.1f}"] if not 0.5 <= scene["map_contrast"] <= 1.5 else []
    words += [f"gamma {scene['gamma']:.1f}"] if scene["gamma"] != 1 else []
    words += [f"exposure {scene['exposure']:.1f}"] if scene["exposure"] >= 1 else []
    words += [scene["picture"]] if scene["picture"] != "as-is" else []
    words += [f"map {scene['given']}, surface {scene['surface']}"] if scene["given"] != scene["surface"] else []
    words += [f"map noise {scene['map_noise']:.2f}"] if scene["map_noise"] > 0.07 else []
    words += [f"{o['kind']} body {o['size']} at {o['apart']}" for o in scene["others"]]
    words += [f"centre at {tuple(scene['centre'])}"] if scene["centre"] else []
    words += [f"hold {','.join(scene['hold'])}"] if scene["hold"] else []
    return "; ".join(words)


def law_of(scene: Row) -> str:
    """A scene's law with its exponent or roughness."""
    parameters = scene["parameters"]
    if "k" in parameters:
        return f"minnaert {parameters['k']:.2f}"
    return f"hapke {parameters['roughness_deg']:.0f} deg" if "w" in parameters else str(scene["law"])


def median(values: Iterable[float]) -> float | None:
    """None of nothing."""
    known = list(values)
    return float(np.median(known)) if known else None
