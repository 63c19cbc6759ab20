"""An evaluation for people (text tables) and for spreadsheets (CSV)."""

import csv
from pathlib import Path
from typing import Any

from lab.evaluate.summary import ALL, WRONG_PX, is_silently_wrong

Row = dict[str, Any]
Summary = list[dict[str, Any]]
FLAT = ("centre_error_px", "range_error", "about_sight_deg", "across_sight_deg", "attitude_error_deg", "surface_px")
HEADER = (
    f"{'profile':12s} {'camera':18s} {'n':>3s} {'ok':>3s} {'dbt':>3s} {'ref':>3s} {'fld':>3s} {'wrong':>5s}   "
    f"{'centre px':>21s}   {'range 1e-4':>13s}   {'attitude deg':>23s}   {'surface px':>13s} {'seconds':>8s}\n"
    f"{'':53s}   {'median    p90     max':>21s}   {'median    p90':>13s}   {'across    p90     about':>23s}   "
    f"{'median    p90':>13s}"
)
STEP_HEADER = (
    f"{'profile':12s} {'step':11s} {'n':>3s}   {'centre px':>15s}   {'range 1e-4':>13s}   {'attitude deg':>15s}   "
    f"{'surface px':>10s} {'seconds':>8s}\n{'':28s}   {'median     p90':>15s}   {'median    p90':>13s}   "
    f"{'across   about':>15s}   {'median':>10s}"
)
CAPTION = f"""\
Sizes of corrected minus true, over the published images (ok and doubtful). wrong: ok, but the centre is more than
{WRONG_PX:g} px off. Attitude: across the line of sight, and about it. Surface: RMS distance between where the pose puts
visible points and where they are. dbt: doubtful, ref: refused, fld: failed."""


def evaluation_table(summary: Summary, rows: list[Row]) -> str:
    """Figures per camera, per step, of the uncertainties, and every image that is not as it should be."""
    parts = [
        "\n".join([HEADER, *map(_line, summary)]),
        "\n".join([STEP_HEADER, *(line for group in summary if group["camera"] == ALL for line in _steps(group))]),
        "\n".join(_sigmas(summary)),
        "\n".join(_not_ok(rows)),
        CAPTION,
    ]
    return "\n\n".join(part for part in parts if part)


def _figure(of: dict[str, Any] | None, which: str, width: int, digits: int, factor: float = 1.0) -> str:
    return f"{'-':>{width}s}" if of is None else f"{factor * of[which]:{width}.{digits}f}"


def _line(group: dict[str, Any]) -> str:
    after = group["after"]
    centre, distance, surface = after["centre_error_px"], after["range_error"], after["surface_px"]
    across, about = after["across_sight_deg"], after["about_sight_deg"]
    counts = " ".join(f"{group[key]:3d}" for key in ("images", "ok", "doubtful", "refused", "failed"))
    seconds = "-" if group["seconds"] is None else f"{group['seconds']:.1f}"
    return (
        f"{group['profile']:12.12s} {group['camera']:18s} {counts} {group['silently_wrong']:5d}   "
        f"{_figure(centre, 'median', 6, 3)} {_figure(centre, 'p90', 6, 2)} {_figure(centre, 'largest', 7, 2)}   "
        f"{_figure(distance, 'median', 6, 2, 1e4)} {_figure(distance, 'p90', 6, 1, 1e4)}   "
        f"{_figure(across, 'median', 7, 3)} {_figure(across, 'p90', 7, 2)} {_figure(about, 'median', 7, 3)}   "
        f"{_figure(surface, 'median', 6, 3)} {_figure(surface, 'p90', 6, 2)} {seconds:>8s}"
    )


def _steps(group: dict[str, Any]) -> list[str]:
    lines = []
    for name, errors in group["steps"].items():
        seconds = group["seconds_of_steps"].get(name)
        centre, distance = errors["centre_error_px"], errors["range_error"]
        across, about = errors["across_sight_deg"], errors["about_sight_deg"]
        lines.append(
            f"{group['profile']:12.12s} {name:11s} {errors['images']:3d}   "
            f"{_figure(centre, 'median', 7, 3)} {_figure(centre, 'p90', 7, 2)}   "
            f"{_figure(distance, 'median', 6, 2, 1e4)} {_figure(distance, 'p90', 6, 1, 1e4)}   "
            f"{_figure(across, 'median', 7, 3)} {_figure(about, 'median', 7, 3)}   "
            f"{_figure(errors['surface_px'], 'median', 10, 3)} {'-' if seconds is None else f'{seconds:.2f}':>8s}"
        )
    return lines


def _sigmas(summary: Summary) -> list[str]:
    lines = []
    for group in summary:
        if group["camera"] != ALL:
            continue
        known = {kind: share for kind, share in group["sigmas"].items() if share}
        reported = ", ".join(
            f"{kind} {share['within_1']:.0%} and {share['within_2']:.0%} of {share['components']}"
            for kind, share in known.items()
        )
        lines.append(
            f"{group['profile']}: within 1 and 2 sigma (68 % and 95 % expected): {reported or 'no uncertainties'}"
        )
    return lines


def _not_ok(rows: list[Row]) -> list[str]:
    lines = []
    for row in rows:
        after = row["after"]
        error = f"centre {after['centre_error_px']:.2f} px off" if after else "no pose"
        if is_silently_wrong(row):
            lines.append(f"{row['profile']:12.12s} {row['product']:16s} SILENTLY WRONG: {error}")
        elif row["status"] != "ok":
            lines.append(f"{row['profile']:12.12s} {row['product']:16s} {row['status']}, {error}: {row['reason']}")
    return lines


def write_csv(path: Path, rows: list[Row]) -> None:
    """One line per image and profile: status, reason, errors before and after, uncertainties, what was planted."""
    flat = [_flat(row) for row in rows]
    columns = list(dict.fromkeys(name for row in flat for name in row))
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, columns, lineterminator="\n")
        writer.writeheader()
        writer.writerows(flat)


def _flat(row: Row) -> Row:
    flat = {key: row[key] for key in ("product", "camera", "profile", "status", "code", "limb_rms_px")}
    for when in ("before", "after"):
        errors = row[when]
        flat |= {f"{when}_{kind}": None if errors is None else errors[kind] for kind in FLAT}
        if errors is not None:
            flat |= {f"{when}_dx_px": errors["centre_px"][0], f"{when}_dy_px": errors["centre_px"][1]}
    flat["silently_wrong"] = is_silently_wrong(row)
    flat["seconds"] = round(sum(row["seconds"].values()), 3)
    flat |= {f"sigma_{kind}": _joined(value) for kind, value in row["uncertainty"].items()}
    return {**flat, **{f"truth_{key}": value for key, value in row["truth"].items()}, "reason": row["reason"]}


def _joined(value: Any) -> Any:
    return " ".join(f"{part:.4g}" for part in value) if isinstance(value, list) else value
