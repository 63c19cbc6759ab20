"""The product folder of one image: cube.zarr, overlay.png, result.json, settings.json and their checksums."""

import json
from pathlib import Path
from typing import Any

from catalog.camera import camera_from_dict
from catalog.errors import RefusedError
from catalog.plain_files import own_json
from catalog.pose import Pose
from catalog.reasons import Reason
from catalog.target import Target
from tasks.atomic import folder_put_in_place
from tasks.publish.checksums import refresh_checksum, write_checksums
from tasks.publish.contained import reading_product
from tasks.publish.cube import open_cube, plain_cube
from tasks.publish.names import CUBE, OVERLAY, RESULT, SETTINGS
from tasks.publish.overlay import draw_overlay
from tasks.publish.plain_cube import write_plain_cube
from tasks.publish.publication import Publication

SHOWN_PRODUCTS = 5


def publish(publication: Publication, store: Path) -> Path:
    """Write `store`/`product` so that a reader sees the old one, or the whole new one, and return its path.

    Raises ValueError when the cube departs from the table of variables, RefusedError as `project_planes`, TypeError or
    ValueError when result, settings or provenance are not plain, finite JSON; nothing is left behind then.
    """
    folder = Path(store) / publication.product
    with folder_put_in_place(folder) as temporary:
        write_product(publication, temporary)
    return folder


def write_product(publication: Publication, folder: Path) -> None:
    """Write the product's parts and checksums into an existing folder, whose appearing is the caller's business."""
    p = publication
    _write_json(folder / SETTINGS, p.settings)
    _write_json(folder / RESULT, {**p.result, "cube": CUBE, "overlay": OVERLAY})
    write_plain_cube(plain_cube(p), folder / CUBE)
    caption = _caption(p.product, p.target.name, p.camera.name, p.pose_after, p.result)
    places = (p.pose_before, p.pose_after, p.camera, p.target, folder / OVERLAY, caption)
    draw_overlay(p.observation.image, *places, stars=p.result.get("stars"))
    write_checksums(folder)


def redraw_overlay(folder: Path) -> Path:
    """Draw the overlay of a product anew, from its cube alone, and return the picture's path.

    Raises RefusedError when the folder holds no cube.
    """
    folder = Path(folder)
    if not (folder / CUBE).is_dir():
        raise no_cube_in(folder)
    with reading_product(folder):
        with open_cube(folder / CUBE) as cube:
            attributes = {key: _loaded(value) for key, value in cube.attrs.items()}
            image = cube["resampled_image" if "resampled_image" in cube else "image"].values
        camera = camera_from_dict(attributes["camera_model"], f"of the cube in {folder}")
        target = Target.model_validate(attributes["target_model"])
        before, after = (Pose.from_dict(attributes[key]) for key in ("pose_before", "pose_after"))
    result = _result_of(folder)
    caption = _caption(attributes["product"], target.name, camera.name, after, result)
    draw_overlay(image, before, after, camera, target, folder / OVERLAY, caption, stars=result.get("stars"))
    refresh_checksum(folder, OVERLAY)
    return folder / OVERLAY


def no_cube_in(folder: Path) -> RefusedError:
    """The refusal of a folder without a cube; of a store it names products."""
    products = sorted(cube.parent.name for cube in Path(folder).glob(f"[!.]*/{CUBE}"))
    if not products:
        remedy = "Give a product folder, as written by `planetpose correct`."
        return RefusedError(Reason.PRODUCT_MISSING, f"{folder} holds no {CUBE}.", remedy)
    named = ", ".join(products[:SHOWN_PRODUCTS]) + (" ..." if len(products) > SHOWN_PRODUCTS else "")
    fault = f"{folder} holds no {CUBE}: it is a store, with the products {named} ({len(products)} in all)."
    return RefusedError(Reason.PRODUCT_MISSING, fault, f"Give one of them: {Path(folder) / products[0]}.")


def _result_of(folder: Path) -> dict[str, Any]:
    """What was recorded of the product; nothing when nobody wrote it down. Raises RefusedError when it was damaged."""
    path = folder / RESULT
    try:
        return dict(own_json(path.read_text())) if path.is_file() else {}
    except ValueError as error:
        fault = f"{path} cannot be read ({error})."
        raise RefusedError(
            Reason.PRODUCT_UNREADABLE, fault, "Look at `planetpose check`, and correct the image anew."
        ) from error


def _loaded(value: Any) -> Any:
    return own_json(value) if isinstance(value, str) and value[:1] in "{[" else value


def _write_json(path: Path, content: dict[str, Any]) -> None:
    path.write_text(json.dumps(content, indent=1, allow_nan=False) + "\n", encoding="utf-8")


def _caption(product: str, target: str, camera: str, pose: Pose, result: dict[str, Any]) -> str:
    """Two lines: what is seen, and what was corrected."""
    found = []
    if result.get("offset_px"):
        found.append("offset ({:+.2f}, {:+.2f}) px".format(*result["offset_px"]))
    if result.get("range_factor"):
        found.append(f"range x {result['range_factor']:.5f}")
    if result.get("attitude_deg"):
        found.append("turn ({:+.2f}, {:+.2f}, {:+.2f}) deg".format(*result["attitude_deg"]))
    if result.get("limb_rms_px") is not None:
        found.append(f"limb rms {result['limb_rms_px']:.2f} px")
    first = f"{product}: {target}, {camera}, {pose.to_dict()['utc'][:19]}Z, range {pose.range_km:,.0f} km"
    return f"{first}\n{', '.join(found)}".rstrip()
