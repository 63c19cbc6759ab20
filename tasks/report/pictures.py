"""The pictures of a report: some of every image, and the distributions of all images together."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from tasks.publish.index_rows import UNREADABLE

if TYPE_CHECKING:
    import pandas as pd

FIGURES = "figures"
KINDS = ("overlay", "residual", "planes", "limb")
USUAL = ("overlay", "residual", "planes")
CAPTIONS = {
    "overlay": (
        "Limb, grid and terminator",
        "The image with the predicted limb (orange, dashed), the corrected limb (light blue), latitudes and longitudes "
        "every 30 degrees (white) and the terminator (yellow, dotted). Other bodies are pink, edges of shadows red and "
        "dashed; identified stars have green rings, other star images orange squares.",
    ),
    "residual": (
        "Image, simulation, residual",
        "Image, simulation and their difference under the corrected pose, and under the predicted one where its target "
        "is in the picture.",
    ),
    "planes": (
        "Planes of the cube",
        "Latitude, longitude, incidence, emission, phase, resolution, uncertainty of the latitude, and flags.",
    ),
    "limb": ("Lit limb", "Segments across the lit limb, image beside simulation."),
}


def drawn(kind: str, folder: Path, pictures: Path, product: str) -> list[Path]:
    """Make the pictures of one kind in the folder `pictures`."""
    from shutil import copyfile

    from tasks.pictures.product import read_product
    from tasks.publish.names import OVERLAY

    path = pictures / f"{product}-{kind}.png"
    if kind == "overlay":
        copyfile(folder / OVERLAY, path)
        return [path]
    if kind == "limb":
        from tasks.pictures.limb_figures import write_limb_figures
        from tasks.pictures.limb_profiles import compare_limbs

        return list(write_limb_figures(compare_limbs(read_product(folder)), pictures, f"{product}-limb").values())
    from tasks.pictures.planes_figure import planes_figure
    from tasks.pictures.residual_figure import residual_figure

    sheet = planes_figure(folder) if kind == "planes" else residual_figure(read_product(folder))
    sheet.save(path)
    return [path]


def last_change(folder: Path) -> float:
    """When a product was published, seconds since 1970."""
    from tasks.publish.names import CUBE, RESULT

    parts = (folder, folder / RESULT, folder / CUBE / "zarr.json")
    return max(part.stat().st_mtime for part in parts if part.exists())


def heading_and_caption(kind: str, stem: str) -> tuple[str, str]:
    """Heading and caption of a picture of this kind in the file `stem`."""
    heading, caption = CAPTIONS[kind]
    return (f"{heading}: {stem.rpartition('-')[2]}", caption) if kind == "limb" else (heading, caption)


def distributions(index: "pd.DataFrame", folder: Path, same: bool = False) -> list[dict[str, Any]]:
    """Draw the figures of all images together. same: the folder has them already."""
    from tasks.pictures.canvas import DRAWING
    from tasks.pictures.store_figures import QUANTITIES, distribution_figure, spread_by_camera

    readable = index[index["status"] != UNREADABLE]
    made = []
    for quantity in QUANTITIES:
        path = folder / f"{quantity.name}.png"
        if not (same and path.is_file()):
            with DRAWING:
                figure = distribution_figure(readable, quantity)
                if figure is None:
                    continue
                figure.savefig(path, format="png")
        rows = spread_by_camera(readable, quantity)
        made.append(
            {
                "file": f"{FIGURES}/{path.name}",
                "label": quantity.label,
                "meaning": quantity.meaning,
                "rows": rows,
                "digits": quantity.digits,
            }
        )
    return made
