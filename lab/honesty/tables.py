"""The benchmark's figures as Markdown, for a person and for the docs."""

from collections.abc import Iterable
from typing import Any

from lab.honesty.report import QUANTITIES, STATUSES

Row = dict[str, Any]
UNITS = {"centre": "px", "range": "", "subpoint": "deg", "roll": "deg", "foreign": "px (centre)", "sun": "deg"}


def markdown(figures: Row) -> str:
    """All tables."""
    statuses = ", ".join(f"{figures['statuses'].get(name, 0)} {name}" for name in STATUSES)
    wrong, cpu = figures["violations"], figures["cpu_s"]
    images = len({entry["id"] for entry in wrong})
    lines = [
        f"{figures['scenes']} scenes: {statuses}. Of {figures['solvable']} solvable ones {figures['solvable_ok']} are "
        f"`ok`{share(figures['solvable_ok'], figures['solvable'])}. Wrong with `ok`: {images} scenes.",
        "Of them with good and rough metadata: "
        + ", ".join(f"{ok} of {all_}{share(ok, all_)}" for ok, all_ in figures["solvable_ok_by_metadata"].values())
        + ".",
        f"Processor time: rendering {cpu['render'] / 60:.1f} min, corrections {cpu['correct'] / 60:.1f} min.",
        "",
        *groups(figures["groups"]),
        "",
        *calibration(figures["calibration"]),
        "",
        *violation_lines(wrong),
        "",
        *not_ok_lines(figures["not_ok"]),
    ]
    return "\n".join(lines) + "\n"


def share(part: int, whole: int) -> str:
    """A percentage in brackets."""
    return f" ({100 * part / whole:.0f} %)" if whole else ""


def row_of(cells: Iterable[Any]) -> str:
    """One line of a table."""
    return "| " + " | ".join(str(cell) for cell in cells) + " |"


def number(value: float | None, form: str = ".3f") -> str:
    """A figure, or nothing."""
    return "" if value is None else format(value, form)


def groups(figures: Row) -> list[str]:
    """Verdicts and errors by group."""
    head = [
        "group",
        "scenes",
        *STATUSES,
        "solvable",
        "of them ok",
        "wrong ok",
        "centre, px",
        "stated",
        "limb, px",
        "CPU s",
    ]
    lines = [row_of(head), row_of(["---"] * len(head))]
    for name, group in figures.items():
        cells = [name, group["scenes"], *(group[s] for s in STATUSES), group["solvable"], group["solvable_ok"]]
        cells += [group["violations"], *(number(group[key]) for key in ("centre_px", "centre_sigma_px", "limb_px"))]
        lines.append(row_of([*cells, number(group["cpu_s"], ".1f")]))
    return lines


def calibration(figures: Row) -> list[str]:
    """Shares within 1 and 2 sigmas, and rms z."""
    head = ["", "scenes", *(f"{name}: 1, 2 sigma; rms z" for name in QUANTITIES)]
    lines = [row_of(head), row_of(["---"] * len(head))]
    for classes in figures.values():
        for name, found in classes.items():
            cells = [name, found["scenes"]]
            for quantity in QUANTITIES:
                each = found[quantity]
                text = (
                    f"{100 * each['within_1']:.0f}, {100 * each['within_2']:.0f} %; {each['rms']:.2f}" if each else ""
                )
                cells.append(text)
            lines.append(row_of(cells))
    return lines


def violation_lines(wrong: list[Row]) -> list[str]:
    """The wrong `ok`s."""
    if not wrong:
        return ["No `ok` is wrong."]
    head = ["scene", "group", "wrong", "by", "components", "sigmas stated", "z", "planted"]
    lines = [row_of(head), row_of(["---"] * len(head))]
    for entry in wrong:
        parts, sigma = (", ".join(f"{value:.4g}" for value in entry.get(key) or ()) or "" for key in ("error", "sigma"))
        by = f"{entry['size']:.4g} {UNITS[entry['kind']] if entry['kind'] != 'range' else 'px of radius'}"
        z = number(entry["z"], ".1f") or "none stated"
        lines.append(row_of([entry["id"], entry["group"], entry["kind"], by, parts, sigma, z, entry["planted"]]))
    return lines


def not_ok_lines(missed: list[Row]) -> list[str]:
    """Solvable scenes that are not `ok`."""
    if not missed:
        return ["Every solvable scene is `ok`."]
    lines = [row_of(["solvable, not ok", "status", "reason", "planted"]), row_of(["---"] * 4)]
    for entry in missed:
        reason = (entry["reason"] or "").replace("|", "/")[:160]
        lines.append(row_of([entry["id"], entry["status"], reason, entry["planted"]]))
    return lines
