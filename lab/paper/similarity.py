"""Similarity of image and simulation: before and after the correction, and against VICAR's undistortion (figure 13)."""

from pathlib import Path

from lab.paper.corrections import corrected, there
from lab.paper.real_images import REAL_IMAGES
from lab.paper.section import NO_DATA, Compared, Context, Section, Table
from tasks.profile import find_profile

NAME = "similarity"
TITLE = "Similarity: before and after, and against VICAR's undistortion"
RAW, VICARS = "f1636832", "f1636832.geo"
PAPER_SSIM, PAPER_GAIN = 0.99, 1e-3
TEXT = (
    "SSIM of image and simulation in the window around the target. The paper's values of about 0.99 are of frames that "
    "are mostly black sky; in the window alone they are lower, and differences larger.",
    "Figure 13 compares the paper's undistorted images with GEOMED ones, each against the same simulation. Here "
    "f1636832 is undistorted by us (raw) and by VICAR (geo), and each is corrected by itself.",
)


def similarity(context: Context) -> Section:
    """SSIM of every real image that is there."""
    products = there(context)
    if not products:
        return Section(NAME, TITLE, missing=NO_DATA)
    standard = find_profile("standard")
    found = {product: corrected(context, product, standard)["similarity"] for product in products}
    rows = [
        (product, REAL_IMAGES[product].title, own["before"], own["after"],
         None if None in own.values() else own["after"] - own["before"])
        for product, own in found.items()
    ]  # fmt: skip
    content = {product: dict(own) for product, own in found.items()}
    compared = []
    vicars = (context.data or Path()) / "images" / "voyager" / VICARS
    if RAW in found and vicars.is_file():
        theirs = corrected(context, RAW, standard, vicars)["similarity"]["after"]
        ours = found[RAW]["after"]
        gain = None if ours is None or theirs is None else ours - theirs
        content["undistortion"] = {"ours": ours, "vicar": theirs, "gain": gain}
        compared = [
            Compared("SSIM of our undistorted image and its simulation", PAPER_SSIM, ours, "", 3, "paper: whole frame"),
            Compared("SSIM of VICAR's (GEOMED)", PAPER_SSIM, theirs, "", 3, "paper: whole frame"),
            Compared("gain of our undistortion", PAPER_GAIN, gain, "", 4, "paper: of the order of 1e-3"),
        ]
    header = ("product", "image", "before", "after", "gain")
    table = Table("SSIM under the predicted and the corrected pose (standard profile)", header, rows, 3)
    return Section(NAME, TITLE, content, compared, [table], text=TEXT)
