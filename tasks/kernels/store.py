"""Kernels of a product or of a whole store: one set per mission."""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from catalog.spice import kernel_pool
from tasks.boundary import reason_of, trouble_of
from tasks.kernels.exposure import Exposure, read_exposure
from tasks.kernels.sets import groups_of, refuse_twins, set_report
from tasks.kernels.write import write_kernel_set
from tasks.publish.check import products_in


def kernels_of(
    paths: Sequence[Path],
    folder: Path,
    kernels: Sequence[Path],
    per_image: bool = False,
    check: bool = True,
    refused: Callable[[Path, str], None] | None = None,
) -> list[dict[str, Any]]:
    """Write kernel sets of the products that `paths` (products or stores) hold into `folder`, and tell about each.

    One set per mission, or per image; with one product its own. check: compare each set with plain SPICE in a second
    process. refused: called with the reason for a product without a readable cube, which is then left out; without it
    the error is raised. Raises RefusedError when a path holds no product.
    """
    exposures = _exposures([product for path in paths for product in products_in(path)], refused)
    refuse_twins(exposures)
    sets = []
    with kernel_pool(kernels) as loaded:
        for name, members in sorted(groups_of(exposures, per_image).items()):
            sets.append((write_kernel_set(name, members, folder, loaded), members))
        in_order = [Path(kernel.for_spice) for kernel in loaded if kernel.kind != "meta"]
    return [set_report(kernel_set, members, in_order if check else None) for kernel_set, members in sets]


def _exposures(products: Sequence[Path], refused: Callable[[Path, str], None] | None) -> list[Exposure]:
    exposures: list[Exposure] = []

    def read(product: Path) -> None:
        exposures.append(read_exposure(product))

    for product in products:
        error = trouble_of(partial(read, product), product.name)
        if error is not None and refused is None:
            raise error
        if error is not None and refused is not None:
            refused(product, reason_of(error))
    return exposures
