"""Which exposures go into which kernel set, and what is reported of a set once it is written."""

from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from catalog.errors import RefusedError
from catalog.reasons import Reason
from tasks.kernels.exposure import Exposure
from tasks.kernels.round_trip import round_trip
from tasks.kernels.write import KernelSet


def groups_of(exposures: Sequence[Exposure], per_image: bool) -> dict[str, list[Exposure]]:
    """Exposures by the name of their kernel set: one set per mission, or per image; with one exposure its own."""
    if per_image or len(exposures) == 1:
        return {e.product: [e] for e in exposures}
    groups: dict[str, list[Exposure]] = defaultdict(list)
    for e in exposures:
        mission = e.camera.mission or e.camera.name
        groups["planetpose_" + "".join(c if c.isalnum() else "-" for c in mission.lower())].append(e)
    return groups


def refuse_twins(exposures: Sequence[Exposure]) -> None:
    """Raise RefusedError when a product is there twice."""
    products = [e.product for e in exposures]
    twice = sorted({p for p in products if products.count(p) > 1})
    if twice:
        raise RefusedError(Reason.PRODUCT_TWICE, f"{', '.join(twice)} is given twice.", "Give each product once.")


def set_report(
    kernel_set: KernelSet, exposures: Sequence[Exposure], mission_kernels: list[Path] | None
) -> dict[str, Any]:
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
