"""What a failed image leaves in its store, in the hidden folder `.failed/PRODUCT`: picture, what was tried, result, and
the frame itself, so that somebody can look at it and help."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from catalog.errors import RefusedError
from catalog.plain_files import own_json
from catalog.pose import Pose
from catalog.regular_file import read_regular_text
from catalog.safe_name import is_safe_product_name
from tasks.atomic import file_put_in_place
from tasks.diagnose.step import TRIED, DiagnoseInputs
from tasks.project.uncertainty import PoseUncertainty
from tasks.publish.contained import refuse_what_is_elsewhere
from tasks.publish.cube import global_attributes, write_group
from tasks.publish.names import RESULT
from tasks.publish.plain_cube import compressor
from tasks.publish.publication import Publication
from tasks.publish.variables import BY_NAME, DIMENSIONS, FLAGS
from tasks.scene_inputs import SceneFiles
from tasks.stored import load_observation

if TYPE_CHECKING:
    import xarray as xr

FAILED = ".failed"
FRAME, REQUEST = "frame.zarr", "request.json"
DAMAGE = (OSError, ValueError, TypeError, KeyError, RefusedError, RecursionError)


def failed_folder(store: Path, product: str) -> Path:
    """Where what was tried for a failed image is left."""
    return Path(store) / FAILED / product


def write_frame(path: Path, inputs: DiagnoseInputs, files: SceneFiles, best: Pose | None) -> None:
    """Write the undistorted frame of a failed image as a Zarr group: `image` and `quality`, and in its attributes
    camera, target, predicted pose, and in place of the corrected one the pose that was most like the image (best). It
    holds no coordinates: the image confirms none."""
    publication = Publication(
        product=inputs.product,
        observation=load_observation(files.image),
        camera=inputs.scene.camera,
        target=inputs.scene.target,
        pose_before=inputs.pose,
        pose_after=best or inputs.pose,
        uncertainty=PoseUncertainty.from_sigmas({}),
        settings={"simulate": inputs.scene.simulate.model_dump(mode="json")},
        provenance={"basemap": inputs.scene.basemap.model_dump(mode="json")},
    )
    dataset = frame_dataset(publication)
    names = ("image", "quality")
    encoding: dict[str, dict[str, Any]] = {
        name: {"chunks": dataset[name].shape, "compressors": [compressor()]} for name in names
    }
    encoding["quality"]["_FillValue"] = None
    write_group(dataset, path, encoding)


def frame_dataset(publication: Publication) -> "xr.Dataset":
    """Image and quality (ny, nx) with the attributes of a cube."""
    import xarray as xr

    observation = publication.observation
    ny, nx = observation.image.shape
    flags = {
        "flag_masks": [int(flag) for flag in FLAGS],
        "flag_meanings": " ".join(str(flag.name).lower() for flag in FLAGS),
    }
    planes = {
        "image": (DIMENSIONS, observation.image.astype(np.float32), dict(BY_NAME["image"].attributes)),
        "quality": (DIMENSIONS, observation.quality.astype(np.uint16), dict(BY_NAME["quality"].attributes) | flags),
    }
    places = {"x": np.arange(nx, dtype=np.int32), "y": np.arange(ny, dtype=np.int32)}
    attributes = global_attributes(publication) | {"title": f"{publication.product}: no pose was found"}
    return xr.Dataset(planes, places, attributes)


def best_pose(folder: Path) -> Pose | None:
    """The pose most like the image that was tried; None where none was."""
    content = own_json(read_regular_text(folder / TRIED))
    found = content.get("best_pose")
    return Pose.from_dict(found) if found else None


def note_result(folder: Path, result: dict[str, Any]) -> None:
    """Exchange the result in the folder of a failed image. Raises OSError."""
    with file_put_in_place(folder / RESULT) as temporary:
        temporary.write_text(json.dumps(result, indent=1, allow_nan=False) + "\n", encoding="utf-8")


def failed_result(store: Path, product: str) -> dict[str, Any]:
    """The result of a failed image; empty where there is none, or it cannot be read."""
    return _content(failed_folder(store, product), RESULT)


def tried_explanations(store: Path, product: str) -> list[dict[str, Any]]:
    """What was tried to explain a failed image, see `tasks.diagnose.trials`; nothing where that is not known."""
    found = _content(failed_folder(store, product), TRIED).get("explanations")
    return [each for each in found if isinstance(each, dict)] if isinstance(found, list) else []


def failed_results(store: Path) -> Iterator[dict[str, Any]]:
    """Results of all failed images of a store, by name; those that cannot be read are passed over."""
    try:
        names = sorted(path.name for path in (Path(store) / FAILED).iterdir() if is_safe_product_name(path.name))
    except OSError:
        return
    for name in names:
        found = failed_result(store, name)
        if found.get("status"):
            yield found | {"product": name}


def _content(folder: Path, name: str) -> dict[str, Any]:
    try:
        refuse_what_is_elsewhere(folder)
        content = own_json(read_regular_text(folder / name))
    except DAMAGE:
        return {}
    return content if isinstance(content, dict) else {}
