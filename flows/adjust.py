"""Adjust: what the images of a store share, solved together from their joint results."""

import json
from functools import partial
from pathlib import Path
from typing import Any

from catalog.camera import camera_from_dict
from catalog.errors import RefusedError
from catalog.plain_text import printable
from catalog.pose import Pose, write_pose_file
from catalog.target import Target
from flows.boundary import reason_of, trouble_of
from tasks.adjust import AdjustSettings, adjust
from tasks.adjust.measurement import Measurement, measurement_of
from tasks.adjust.report import adjusted_poses, report_of
from tasks.atomic import file_put_in_place
from tasks.publish.check import products_in
from tasks.publish.contained import reading_product
from tasks.publish.cube import open_cube
from tasks.publish.names import CUBE

REPORT = "adjust.json"


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
    report = {"store": str(store), **report_of(images, adjustment, settings), "left_out": left_out}
    if out is not None:
        write_adjustment(out, images, adjusted_poses(images, adjustment), report)
    return report


def measurement_in(folder: Path) -> Measurement:
    """The joint result of a product's folder. Raises RefusedError when there is none."""
    if not (folder / CUBE).is_dir():
        raise RefusedError("product-missing", f"{folder} holds no {CUBE}.", "Give a store of `planetpose correct`.")
    with reading_product(folder):
        with open_cube(folder / CUBE) as cube:
            attributes = {
                key: json.loads(value) if isinstance(value, str) and value[:1] in "{[" else value
                for key, value in cube.attrs.items()
            }
        return measurement_of(
            str(attributes["product"]),
            camera_from_dict(attributes["camera_model"], f"of the cube in {folder}"),
            Target.model_validate(attributes["target_model"]),
            Pose.from_dict(attributes["pose_before"]),
            attributes["settings"],
            attributes["provenance"],
        )


def write_adjustment(out: Path, images: list[Measurement], poses: list[Pose], report: dict[str, Any]) -> None:
    """Pose files and the report."""
    out.mkdir(parents=True, exist_ok=True)
    for image, pose in zip(images, poses, strict=True):
        with file_put_in_place(out / f"{image.product}.pose.json") as temporary:
            write_pose_file(pose, temporary)
    with file_put_in_place(out / REPORT) as temporary:
        temporary.write_text(json.dumps(report, indent=1, allow_nan=False) + "\n", encoding="utf-8")
