"""Section 4.2 of the paper, figures 14 to 18: segments across the lit limb of real images, before and after."""

from pathlib import Path
from typing import Any

from lab.paper.corrections import corrected, there
from lab.paper.real_images import REAL_IMAGES
from lab.paper.section import NO_DATA, Context, Picture, Section, Table
from tasks.pictures.limb_figures import write_limb_figures
from tasks.pictures.limb_profiles import LimbComparison, compare_limbs
from tasks.pictures.product import read_product
from tasks.profile import find_profile

NAME = "limb"
TITLE = "Limb segments, before and after the correction"
SHOWN = ("C0552809300R", "f1636832")
CAPTIONS = {
    "segments": ("Segments across the lit limb, coloured by the shift between image and simulation.", "figure 14"),
    "profiles": ("Brightness along segments, image and simulation; dotted: the corrected limb.", "figure 15"),
    "derivatives": ("Derivatives of the same segments.", "figure 16"),
    "shifts": ("One segment and its derivative with the pose off (above) and corrected (below), and all shifts.",
               "figures 17 and 18"),
}  # fmt: skip
TEXT = (
    "Rows and columns of pixels across the lit limb, whichever crosses it less tangentially. The shift is that of the "
    "derivative's extremum between image and simulation, outward positive; the paper shows such segments and gives no "
    "number. Corrected by the standard profile. `planetpose show PRODUCT --limb` draws these four for any product.",
)


def limb(context: Context) -> Section:
    """Pictures of two images, figures of all that are there."""
    products = there(context)
    if not products:
        return Section(NAME, TITLE, missing=NO_DATA)
    content: dict[str, Any] = {}
    rows, pictures = [], []
    for product in products:
        result = corrected(context, product, find_profile("standard"))
        if not result["cube"]:
            rows.append((product, REAL_IMAGES[product].title, result["status"], *[None] * 6))
            continue
        comparison = compare_limbs(read_product(Path(result["cube"]).parent))
        content[product] = figures(comparison, result)
        rows.append((product, REAL_IMAGES[product].title, result["status"], *content[product].values()))
        if product in SHOWN:
            files = write_limb_figures(comparison, context.figures, f"{product}-limb")
            pictures += [Picture(path.name, f"{product}: {CAPTIONS[kind][0]}", CAPTIONS[kind][1])
                         for kind, path in files.items()]  # fmt: skip
    header = ("product", "image", "status", "segments before", "rms before, px", "segments after", "rms after, px",
              "mean outward after, px", "rms in the result, px")  # fmt: skip
    return Section(NAME, TITLE, content, tables=[Table("Shift between image and simulation", header, rows, 3)],
                   pictures=pictures, text=TEXT)  # fmt: skip


def figures(comparison: LimbComparison, result: dict[str, Any]) -> dict[str, Any]:
    """One image in paper.json; before is None when the predicted limb is too far away for segments."""
    before, after = comparison.before, comparison.after
    return {
        "segments_before": None if before is None else len(before.shift_px),
        "rms_before_px": None if before is None else before.rms_px,
        "segments_after": len(after.shift_px),
        "rms_after_px": after.rms_px,
        "mean_after_px": float(after.shift_px.mean()) if len(after.shift_px) else None,
        "limb_rms_px": result["limb_rms_px"],
    }
