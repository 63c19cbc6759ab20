"""Section 2 of the paper: how well each distortion method predicts the reseau marks of raw Voyager frames."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from lab.paper.section import NO_DATA, Cell, Compared, Context, Picture, Section, Table
from tasks.distortion.report import distortion_report

NAME = "reseau"
TITLE = "Reseau marks: RMSD of the distortion methods"
FRAMES = ("f1636832.raw", "C3580800_RAW.IMG", "C1124748_RAW.IMG", "C2069302_RAW.IMG", "c4400436.imq")
SHOWN = "f1636832"
PAPER_RMSD_PX = {"radial": 17.3, "polynomial": 0.47}
TEXT = (
    "The paper gives averages over 382 images, whose marks the archive had measured: 17.3 px for a radial function of "
    "degree 9, 0.47 px for a general polynomial of degree 6, and none for local bilinear transformations, whose marks "
    "match by construction. Ours are averages over the raw frames of the data folder, with marks found in the frame "
    "itself. Leave-one-out predicts each mark from all others, so every method gets an honest figure.",
    "The paper's radial function is in r = sqrt(x^2 + y^2) of pixel coordinates, as printed, so about pixel (0, 0): so "
    "fitted we get about its figure. About the optical centre the same function is much better, though not good.",
)


def reseau(context: Context) -> Section:
    """Every method on every raw frame that is there."""
    folder = (context.data or Path()) / "images" / "voyager"
    paths = [folder / name for name in FRAMES if context.data and (folder / name).is_file()]
    if not paths:
        return Section(NAME, TITLE, missing=NO_DATA)
    reports = {}
    for path in paths:
        context.tell(f"reseau: {path.name}")
        out = context.figures if path.name.startswith(SHOWN) else None
        report = distortion_report(path, out)
        reports[report["product"]] = report
    means = mean_figures(reports)
    return Section(
        NAME,
        TITLE,
        content={"frames": {name: frame_entry(report) for name, report in reports.items()}, "mean": means},
        compared=compared(means, len(reports)),
        tables=[table(reports, means)],
        pictures=pictures(reports),
        text=TEXT,
    )


def frame_entry(report: dict[str, Any]) -> dict[str, Any]:
    """One frame in paper.json."""
    names = ("camera", "marks_found", "marks_expected", "marks_used", "methods", "chosen",
             "radial_about_pixel_zero_rmsd_px", "polynomial_in_pixel_powers_condition_number")  # fmt: skip
    return {name: report[name] for name in names}


def mean_figures(reports: Mapping[str, dict[str, Any]]) -> dict[str, dict[str, float]]:
    """RMSD and leave-one-out error of each method, averaged over the frames in which it was fitted."""
    methods = dict.fromkeys(method for report in reports.values() for method in report["methods"])
    found: dict[str, dict[str, float]] = {}
    for method in methods:
        own = [report["methods"][method] for report in reports.values() if method in report["methods"]]
        keys = ("rmsd_px", "leave_one_out_px", "leave_one_out_median_px")
        found[method] = {key: float(np.mean([each[key] for each in own])) for key in keys} | {"frames": len(own)}
    corner = [report["radial_about_pixel_zero_rmsd_px"] for report in reports.values()]
    return found | {"radial about pixel (0, 0)": {"rmsd_px": float(np.mean(corner)), "frames": len(corner)}}


def compared(means: dict[str, dict[str, float]], frames: int) -> list[Compared]:
    """The paper's two figures, and the leave-one-out errors it has none for."""
    averaged = f"the paper's over 382 images, ours over {frames}"
    rows = [
        Compared("radial, degree 9, about pixel (0, 0) as printed: RMSD", PAPER_RMSD_PX["radial"],
                 means["radial about pixel (0, 0)"]["rmsd_px"], "px", 2, averaged),
        Compared("radial, degree 9, about the optical centre: RMSD", PAPER_RMSD_PX["radial"],
                 means["radial"]["rmsd_px"], "px", 2, averaged),
        Compared("polynomial, degree 6: RMSD", PAPER_RMSD_PX["polynomial"], means["polynomial"]["rmsd_px"], "px", 2,
                 averaged),
    ]  # fmt: skip
    for method, figures in means.items():
        if "leave_one_out_px" in figures:
            note = "the paper: cannot be given, matched by construction" if method == "delaunay" else ""
            rows.append(Compared(f"{method}: leave-one-out", None, figures["leave_one_out_px"], "px", 2, note))
    return rows


def table(reports: Mapping[str, dict[str, Any]], means: dict[str, dict[str, float]]) -> Table:
    """RMSD / leave-one-out of each frame and method."""
    methods = [method for method in means if "leave_one_out_px" in means[method]]
    header = ("frame", "camera", "marks", "radial about (0, 0)", *(f"{m}: RMSD / left out" for m in methods), "chosen")
    rows: list[list[Cell]] = [
        [
            name,
            report["camera"],
            f"{report['marks_found']} of {report['marks_expected']} ({report['marks_used']})",
            report["radial_about_pixel_zero_rmsd_px"],
            *(_pair(report["methods"].get(method)) for method in methods),
            report["chosen"],
        ]
        for name, report in reports.items()
    ]
    return Table("Each frame, pixels of the undistorted frame", header, rows)


def _pair(figures: dict[str, float] | None) -> str | None:
    return None if figures is None else f"{figures['rmsd_px']:.2f} / {figures['leave_one_out_px']:.2f}"


def pictures(reports: Mapping[str, dict[str, Any]]) -> list[Picture]:
    """Marks and residuals of the frame that is shown."""
    captions = {
        "marks": ("Marks found in the raw frame.", "figure 3"),
        "residuals": ("Leave-one-out errors of each method at the marks.", "figure 4"),
    }
    files = [Path(path).name for path in reports.get(SHOWN, {}).get("figures", [])]
    return [Picture(file, *captions[kind]) for file in files for kind in captions if file.endswith(f"-{kind}.png")]
