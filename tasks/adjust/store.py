"""Adjust: what the images of a store share, solved together from their joint results."""

from functools import partial
from pathlib import Path
from typing import Any

from catalog.errors import RefusedError
from catalog.plain_text import printable
from tasks.adjust import AdjustSettings, adjust
from tasks.adjust.files import measurement_in, write_adjustment
from tasks.adjust.measurement import Measurement
from tasks.adjust.report import adjusted, report_of
from tasks.boundary import reason_of, trouble_of
from tasks.publish.check import products_in


def adjust_store(store: Path, settings: AdjustSettings, out: Path | None = None) -> dict[str, Any]:
    """The report (see `tasks.adjust.report.report_of`) on all images of `store`; `left_out` lists those without a joint
    result. out: folder for the report and a pose file per image, PRODUCT.pose.json, from which `planetpose correct
    --resume` goes on. Raises RefusedError when no image can be used."""
    images: list[Measurement] = []
    left_out: list[dict[str, str]] = []

    def measure(folder: Path) -> None:
        images.append(measurement_in(folder))

    for folder in products_in(store):
        error = trouble_of(partial(measure, folder), folder.name)
        if error is not None:
            left_out.append({"product": printable(folder.name), "reason": reason_of(error)})
    if not images:
        raise RefusedError(
            "nothing-to-adjust",
            f"{store} holds no image that the joint step corrected ({len(left_out)} others).",
            "Correct images with a profile that has the step joint.",
        )
    adjustment = adjust(images, settings)
    found = adjusted(images, adjustment)
    report = {"store": str(store), **report_of(images, adjustment, found, settings), "left_out": left_out}
    if out is not None:
        write_adjustment(out, images, found.poses, report)
    return report
