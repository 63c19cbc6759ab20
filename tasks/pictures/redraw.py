"""Pictures of a finished product, put into its folder."""

from pathlib import Path

from tasks.pictures.limb_figures import write_limb_figures
from tasks.pictures.limb_profiles import compare_limbs
from tasks.pictures.planes_figure import planes_figure
from tasks.pictures.product import read_product
from tasks.pictures.residual_figure import residual_figure
from tasks.publish.checksums import refresh_checksum

PLANES, RESIDUAL = "planes.png", "residual.png"


def draw_limb(folder: Path, basemap: Path | None = None) -> list[Path]:
    """Draw the lit limb of a product, image beside simulation, before and after its correction; the product's checksums
    know the pictures then. Returns their paths. Raises RefusedError as `read_product`."""
    paths = list(write_limb_figures(compare_limbs(read_product(folder, basemap)), folder).values())
    for path in paths:
        refresh_checksum(folder, path.name)
    return paths


def draw_residual(folder: Path, basemap: Path | None = None) -> Path:
    """Draw image, simulation and residual, before and after the correction. Raises RefusedError as `read_product`."""
    product = read_product(folder, basemap)
    residual_figure(product).save(folder / RESIDUAL)
    refresh_checksum(folder, RESIDUAL)
    return folder / RESIDUAL


def draw_planes(folder: Path) -> Path:
    """Draw the planes of the cube. Raises RefusedError when the folder holds none."""
    planes_figure(folder).save(folder / PLANES)
    refresh_checksum(folder, PLANES)
    return folder / PLANES
