"""What an adjustment reads of products, and the files that it leaves."""

import json
from pathlib import Path
from typing import Any

from catalog.camera import camera_from_dict
from catalog.errors import RefusedError
from catalog.pose import Pose, write_pose_file
from catalog.reasons import Reason
from catalog.target import Target
from tasks.adjust.measurement import Measurement, measurement_of
from tasks.atomic import file_put_in_place
from tasks.publish.contained import reading_product
from tasks.publish.cube import open_cube
from tasks.publish.names import CUBE
from tasks.publish.stars import stars_of_product
from tasks.stars.separate import orientation_stated

REPORT = "adjust.json"


def measurement_in(folder: Path) -> Measurement:
    """The joint result of a product's folder. Raises RefusedError when there is none."""
    if not (folder / CUBE).is_dir():
        raise RefusedError(
            Reason.PRODUCT_MISSING, f"{folder} holds no {CUBE}.", "Give a store of `planetpose correct`."
        )
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
            orientation_stated(stars_of_product(folder)),
        )


def write_adjustment(out: Path, images: list[Measurement], poses: list[Pose], report: dict[str, Any]) -> None:
    """Pose files and the report."""
    out.mkdir(parents=True, exist_ok=True)
    for image, pose in zip(images, poses, strict=True):
        with file_put_in_place(out / f"{image.product}.pose.json") as temporary:
            write_pose_file(pose, temporary)
    with file_put_in_place(out / REPORT) as temporary:
        temporary.write_text(json.dumps(report, indent=1, allow_nan=False) + "\n", encoding="utf-8")
