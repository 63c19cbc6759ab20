"""Real images by every registration: the same paper profile, one method exchanged."""

from typing import Any

import numpy as np

from lab.paper.charts import centres_figure
from lab.paper.corrections import corrected, method_profile, there
from lab.paper.real_images import REAL_IMAGES
from lab.paper.section import NO_DATA, Cell, Compared, Context, Picture, Section, Table
from tasks.boundary import PUBLISHED
from tasks.point.registration import REGISTRATIONS
from tasks.profile import find_profile

NAME = "methods"
TITLE = "Real images by every registration"
PAPER, STANDARD = "paper", "standard"
TIMED, BAR_S = "C0552809300R", 15.0
Found = dict[str, dict[str, dict[str, Any]]]
TEXT = (
    "Profile `paper` with the registration exchanged: pointing by that method, range by SSIM, attitude by flow and "
    "Kabsch, then pointing once more. The last rows are the profile `paper` as a whole, with all its passes, and the "
    "standard profile, which fits the lit limb and a mixture of photometric laws.",
    "What is known otherwise: the range of Europa's label is good to parts per million, so its factor should be 1; "
    "JPL's limb fits of f1636832 put Io's centre at x 606.9 to 608.1, y 542.1 to 542.2; Pluto's trajectory is known, "
    "so its factor should be 1.000; Enceladus has a rough pose (its range is a guess from the disk's size, its "
    "attitude any), so its markings cannot match.",
)


def methods(context: Context) -> Section:
    """Centre, range factor, limb and time, of every image by every method."""
    products = there(context)
    if not products:
        return Section(NAME, TITLE, missing=NO_DATA)
    profiles = {method: method_profile(method) for method in sorted(REGISTRATIONS)}
    profiles |= {name: find_profile(name) for name in (PAPER, STANDARD)}
    found = {
        product: {method: corrected(context, product, profile) for method, profile in profiles.items()}
        for product in products
    }
    centres = {
        REAL_IMAGES[product].title: {m: r["centre_px"] for m, r in own.items() if r["centre_px"]}
        for product, own in found.items()
    }
    picture = context.save(centres_figure(centres, STANDARD), "methods")
    return Section(
        NAME,
        TITLE,
        content={product: {method: entry(result) for method, result in own.items()} for product, own in found.items()},
        compared=compared(found),
        tables=[*(table(product, own) for product, own in found.items()), step_table(found)],
        pictures=[
            Picture(picture, "Centre of the disk by every method, relative to the standard profile's.", "figure 7")
        ],
        text=TEXT,
    )


def entry(result: dict[str, Any]) -> dict[str, Any]:
    """One correction in paper.json."""
    keys = ("status", "reason", "centre_px", "offset_px", "range_factor", "attitude_deg", "limb_rms_px", "limb_points")
    return {key: result[key] for key in keys} | {
        "similarity": result["similarity"],
        "seconds": seconds(result),
        "seconds_of_steps": result["seconds"],
    }


def seconds(result: dict[str, Any]) -> float:
    """Of all steps, when they were done."""
    return round(sum(result["seconds"].values()), 1)


def compared(found: Found) -> list[Compared]:
    """The time of the whole paper profile on the disk of 226 px."""
    own = found.get(TIMED, {}).get(PAPER)
    if own is None:
        return []
    note = f"bar {BAR_S:.0f} s on one core; the paper gives none; as measured when the steps were done"
    return [Compared("whole profile paper, Europa 226 px wide", None, seconds(own), "s", 1, note)]


def step_table(found: Found) -> Table:
    """Seconds of every step of the whole paper profile."""
    steps = dict.fromkeys(step for own in found.values() for step in own[PAPER]["seconds"])
    rows: list[list[Cell]] = [[step, *(own[PAPER]["seconds"].get(step) for own in found.values())] for step in steps]
    return Table(
        "Seconds of each step, profile paper", ("step", *(REAL_IMAGES[product].title for product in found)), rows
    )


def table(product: str, own: dict[str, dict[str, Any]]) -> Table:
    """One image by every method."""
    header = ("method", "status", "centre x, px", "y, px", "range factor", "turn, deg", "limb rms, px", "SSIM before",
              "after", "s")  # fmt: skip
    rows: list[list[Cell]] = []
    for method, result in own.items():
        x, y = result["centre_px"] or (None, None)
        turn = None if result["attitude_deg"] is None else float(np.linalg.norm(result["attitude_deg"]))
        factor, similarity = result["range_factor"], result["similarity"]
        code = "" if result["status"] == "ok" else f": {str(result['reason']).partition(':')[0]}"
        rows.append([
            method, result["status"] + code, x, y, None if factor is None else f"{factor:.5f}", turn,
            result["limb_rms_px"], similarity["before"], similarity["after"], f"{seconds(result):.0f}",
        ])  # fmt: skip
    published = sum(result["status"] in PUBLISHED for result in own.values())
    return Table(f"{REAL_IMAGES[product].title} ({product}): {published} of {len(own)} published", header, rows, 3)
