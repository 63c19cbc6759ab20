"""Pictures of a finished product's limb, put into its folder."""

from pathlib import Path

from tasks.pictures.limb_figures import write_limb_figures
from tasks.pictures.limb_profiles import compare_limbs
from tasks.pictures.product import read_product
from tasks.publish.checksums import refresh_checksum


def draw_limb(folder: Path, basemap: Path | None = None) -> list[Path]:
    """Draw the lit limb of a product, image beside simulation, before and after its correction; the product's checksums
    know the pictures then. Returns their paths. Raises RefusedError as `read_product`."""
    paths = list(write_limb_figures(compare_limbs(read_product(folder, basemap)), folder).values())
    for path in paths:
        refresh_checksum(folder, path.name)
    return paths
