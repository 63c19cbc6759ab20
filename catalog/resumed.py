"""The pose of an earlier result, from which corrections can start."""

from pathlib import Path

from catalog.errors import RefusedError
from catalog.plain_files import read_json_file
from catalog.pose import PartialPose, Pose
from catalog.regular_file import is_folder, is_regular

RESULT = "result.json"
REMEDY = "Give a product folder, its result.json, a pose file, or a folder with one of them per product."


def pose_to_resume(path: Path | None, product: str) -> Pose | None:
    """The pose of a product in a file or folder, None without one. Raises RefusedError, naming the file and the fault,
    when there is none for this product."""
    if path is None:
        return None
    if is_folder(path):
        candidates = (path / RESULT, path / product / RESULT, path / f"{product}.pose.json")
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
