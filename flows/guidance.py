"""How the user helped or overruled the corrections of one image: where they start, what they hold, what they mask."""

from typing import Any

from catalog.errors import RefusedError
from catalog.plain_files import read_json_file
from catalog.plain_text import shown_path
from catalog.pose import PartialPose, Pose
from catalog.regular_file import is_folder, is_regular
from flows.request import Request

RESULT = "result.json"
REMEDY = "Give a product folder, its result.json, a pose file, or a folder with one of them per product."


def guidance_of(request: Request) -> dict[str, Any]:
    """What the result says of the request's: plain JSON, None or empty for what was not used."""
    return {
        "start_offset_px": list(request.start_offset_px) if request.start_offset_px else None,
        "held": list(request.profile.hold),
        "mask": shown_path(request.mask) if request.mask else None,
        "flip": request.flip,
        "plane": request.plane,
        "summing": request.summing,
        "window": list(request.window) if request.window else None,
        "resumed_from": shown_path(request.resume) if request.resume else None,
    }


def is_started_elsewhere(request: Request) -> bool:
    """Whether the corrections start from another pose than the predicted one."""
    return request.start_offset_px is not None or request.resume is not None


def pose_to_resume(request: Request) -> Pose | None:
    """The pose that the user wants to start from. Raises RefusedError, naming the file and the fault, when
    there is none for this image."""
    path = request.resume
    if path is None:
        return None
    if is_folder(path):
        name = request.product
        candidates = (path / RESULT, path / name / RESULT, path / f"{name}.pose.json")
        path = next((candidate for candidate in candidates if is_regular(candidate)), path / RESULT)
    try:
        content = read_json_file(path)
        pose = content.get("pose", content) if isinstance(content, dict) else None
        if not isinstance(pose, dict):
            raise ValueError("it holds no corrected pose")
        return PartialPose.from_dict(pose).completed()
    except OSError as error:
        raise RefusedError("resume-unreadable", f"{path} cannot be read ({error}).", REMEDY) from error
    except (ValueError, RecursionError) as error:
        raise RefusedError("resume-invalid", f"{path}: {error}.", REMEDY) from error
