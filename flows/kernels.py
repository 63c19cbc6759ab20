"""Kernels of a product or of a whole store: one set per mission."""

from collections import defaultdict
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from catalog.errors import RefusedError
from catalog.spice import kernel_pool
from flows.boundary import reason_of, trouble_of
from tasks.kernels.exposure import Exposure, read_exposure
from tasks.kernels.round_trip import round_trip
from tasks.kernels.write import KernelSet, write_kernel_set
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
    _refuse_twins(exposures)
    sets = []
    with kernel_pool(kernels) as loaded:
        for name, members in sorted(_groups(exposures, per_image).items()):
            sets.append((write_kernel_set(name, members, folder, loaded), members))
        in_order = [Path(kernel.for_spice) for kernel in loaded if kernel.kind != "meta"]
    return [told(kernel_set, members, in_order if check else None) for kernel_set, members in sets]


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


def _groups(exposures: Sequence[Exposure], per_image: bool) -> dict[str, list[Exposure]]:
    if per_image or len(exposures) == 1:
        return {e.product: [e] for e in exposures}
    groups: dict[str, list[Exposure]] = defaultdict(list)
    for e in exposures:
        mission = e.camera.mission or e.camera.name
        groups["planetpose_" + "".join(c if c.isalnum() else "-" for c in mission.lower())].append(e)
    return groups


def _refuse_twins(exposures: Sequence[Exposure]) -> None:
    products = [e.product for e in exposures]
    twice = sorted({p for p in products if products.count(p) > 1})
    if twice:
        raise RefusedError("product-twice", f"{', '.join(twice)} is given twice.", "Give each product once.")


def told(kernel_set: KernelSet, exposures: Sequence[Exposure], mission_kernels: list[Path] | None) -> dict[str, Any]:
    """The set as `--json` prints it. mission_kernels: None leaves out the round trip."""
    left = {(note["product"], kind) for note in kernel_set.left_out for kind in _kinds_of(note["what"])}
    trips: dict[str, Any] = {}
    for kind in kernel_set.meta_kernels if mission_kernels is not None else ():
        complete = [e for e in exposures if (e.product, kind) not in left]
        found = round_trip(kernel_set, complete, kind, mission_kernels or ()) if complete else []
        trips[kind] = {name: max(trip[name] for trip in found) for name in found[0]} if found else None
    return {
        "name": kernel_set.name,
        "products": kernel_set.products,
        "meta_kernels": {kind: str(path) for kind, path in kernel_set.meta_kernels.items()},
        "files": [str(path) for path in kernel_set.files.values()],
        "left_out": kernel_set.left_out,
        "round_trip_deg": trips,
    }


def _kinds_of(what: str) -> tuple[str, ...]:
    """Which of the set's two uses an exposure is missing from."""
    if what == "platform":
        return ()
    return (what,) if what in ("alone", "mission") else ("alone", "mission")
