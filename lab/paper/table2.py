"""Table 2, figures 11 and 12: offsets and range factors per camera, from the supplement and an evaluation."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from lab.paper.charts import histograms_figure
from lab.paper.evaluation import (
    Found,
    by_profile,
    camera_entry,
    evaluation_table,
    offsets,
    read_evaluation,
    statistics,
    verdict_table,
)
from lab.paper.section import Cell, Compared, Context, Picture, Section, Table
from lab.simulate.europa57 import paper_images

NAME = "table2"
TITLE = "Table 2, figures 11 and 12: offsets and range factors per camera"
# (mean, smallest, largest) of the length of the offset, of |x| and of |y|, pixels.
PAPER_OFFSETS_PX: dict[str, tuple[tuple[float, ...], ...]] = {
    "voyager1-nac": ((186.1, 0.0, 796.4), (160.9, 0.0, 537.2), (64.6, 0.0, 777.0)),
    "voyager1-wac": ((131.1, 7.2, 675.9), (104.8, 2.0, 478.2), (63.6, 0.0, 447.7)),
    "voyager2-nac": ((63.5, 1.2, 191.1), (44.9, 0.9, 135.1), (44.9, 0.9, 135.1)),
    "voyager2-wac": ((81.2, 52.5, 340.5), (57.4, 37.1, 240.8), (57.4, 37.1, 240.8)),
    "newhorizons-lorri": ((18.1, 11.0, 23.4), (15.0, 3.8, 22.6), (9.4, 6.0, 13.6)),
    "galileo-ssi": ((22.4, 1e-5, 120.9), (15.9, 1e-5, 85.5), (15.77, 1e-5, 85.5)),
}
TEXT = (
    "The paper's offsets are of C-kernels that are not public in one piece, so they cannot be measured again here. "
    "What can: an archive simulated with errors like these and corrected (`--evaluation DIR`, written by `planetpose "
    "evaluate`), where the truth is known, so that each found offset has an error.",
    "The paper's table prints the same numbers for x and y of both Voyager 2 cameras (and nearly so for SSI), and each "
    "length there is sqrt(2) times them: one column must have been copied, so its lengths are those of (x, x).",
    "Figure 12: the paper scanned 0.99 to 1.01 and says that the distance was always overestimated; its supplement has "
    "factors from 0.985, where 8 images sit exactly, to 1.001.",
)


def table2(context: Context) -> Section:
    """Statistics per camera of the paper, its supplement and the evaluation."""
    read = read_evaluation(context.evaluation) if context.evaluation else {"images": [], "summary": []}
    evaluated = by_profile(read["images"])
    kdist = factors_of_supplement()
    content: dict[str, Any] = {
        "paper_offsets_px": {camera: dict(zip(("length", "x", "y"), own, strict=True))
                             for camera, own in PAPER_OFFSETS_PX.items()},
        "supplement_range_factor": {camera: statistics(values) for camera, values in kdist.items()},
    }  # fmt: skip
    tables = [paper_table(), factor_table("Range factors of the supplement (kdist)", kdist)]
    pictures = [factor_picture(context, "table2-kdist", kdist, "Range factors of the supplement")]
    compared: list[Compared] = []
    text = list(TEXT)
    if not evaluated:
        text.append("No evaluation was given, so there are no offsets of ours here.")
    for profile, rows in evaluated.items():
        found = offsets(rows)
        content.setdefault("evaluation", {})[profile] = {camera: camera_entry(own) for camera, own in found.items()}
        compared += compare(profile, found)
        tables.append(evaluation_table(profile, found))
        pictures += evaluation_pictures(context, profile, found)
    if read["summary"]:
        tables.append(verdict_table(read["summary"]))
    return Section(NAME, TITLE, content, compared, tables, pictures, text)


def factors_of_supplement() -> dict[str, list[float]]:
    """kdist of each image, per camera; LORRI's are 1 throughout."""
    images = paper_images().values()
    cameras = dict.fromkeys(image.camera for image in images)
    return {camera: [image.range_factor for image in images if image.camera == camera] for camera in cameras}


def compare(profile: str, found: Found) -> list[Compared]:
    """Mean offset of each camera beside the paper's: planted like it, so alike by design."""
    note = f"profile {profile}; planted errors drawn after the paper's, so alike by design"
    return [
        Compared(f"{camera}: mean offset", PAPER_OFFSETS_PX[camera][0][0],
                 float(np.hypot(*own["found_px"].T).mean()), "px", 1, note)
        for camera, own in found.items() if camera in PAPER_OFFSETS_PX
    ]  # fmt: skip


def paper_table() -> Table:
    """The paper's table 2."""
    header = ("camera", *(f"{name} {which}" for name in ("offset", "|x|", "|y|") for which in ("mean", "min", "max")))
    rows: list[list[Cell]] = [
        [camera, *(value for triple in own for value in triple)] for camera, own in PAPER_OFFSETS_PX.items()
    ]
    return Table("The paper's table 2, pixels", header, rows, 1)


def factor_table(caption: str, factors: Mapping[str, Sequence[float]]) -> Table:
    """Range factors per camera."""
    rows: list[list[Cell]] = []
    for camera, values in factors.items():
        own = statistics(values)
        rows.append([camera, own["images"], own["mean"], own["min"], own["max"], sum(v > 1 for v in values)])
    return Table(caption, ("camera", "images", "mean", "smallest", "largest", "above 1"), rows, 4)


def evaluation_pictures(context: Context, profile: str, found: Found) -> list[Picture]:
    """Figures 11 and 12 of an evaluation."""
    per_camera = {camera: np.hypot(*own["found_px"].T).tolist() for camera, own in found.items()}
    largest = max(max(values) for values in per_camera.values())
    figure = histograms_figure(per_camera, "offset, px", np.linspace(0, largest, 21).tolist())
    file = context.save(figure, f"table2-offsets-{profile}")
    factors = {camera: own["factor"].tolist() for camera, own in found.items()}
    return [
        Picture(file, f"Offsets found in the evaluation, profile {profile}.", "figure 11"),
        factor_picture(context, f"table2-factors-{profile}", factors, f"Range factors found, profile {profile}"),
    ]


def factor_picture(context: Context, name: str, factors: Mapping[str, Sequence[float]], caption: str) -> Picture:
    """Histograms of range factors, per camera."""
    values = [value for own in factors.values() for value in own]
    low, high = min(0.984, *values), max(1.002, *values)
    width = max(round((high - low) / 20, 3), 0.001)
    bins = np.arange(low - width / 2, high + width, width).tolist()
    figure = histograms_figure(factors, "range factor", bins, columns=4, mark=1.0)
    return Picture(context.save(figure, name), f"{caption}; dotted: 1.", "figure 12")
