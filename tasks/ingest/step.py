"""The cached step: read an image file's metadata, and name its camera and target."""

from typing import Any

from catalog.camera import find_camera
from catalog.errors import RefusedError
from catalog.observation import Frame
from tasks.plain import plain
from tasks.stored import frame_of
from tasks.work import Work

MAX_LABEL_VALUES = 2000


def run(work: Work) -> dict[str, Any]:
    """What the file says; pixels stay in the file. Raises RefusedError when camera or target stay unknown."""
    frame = frame_of(work)
    if frame.camera is None:
        raise RefusedError(
            "camera-unknown",
            f"image {frame.path}: its label names no camera of the catalog.",
            "Give --camera NAME (see `planetpose cameras`) or --camera FILE.toml.",
        )
    if frame.target is None:
        fault = frame.unclear.get("target", "its label names no target")
        raise RefusedError(
            "target-unknown", f"image {frame.path}: {fault}.", "Say which body is meant: --target NAME or FILE.toml."
        )
    camera = find_camera(str(work.places.get("camera") or frame.camera))
    return {
        "product": frame.product,
        "sha256": frame.sha256,
        "format": frame.format,
        "camera": camera.model_dump(mode="json", exclude_unset=True),
        "target_name": frame.target,
        "et": frame.et,
        "exposure_s": frame.exposure_s,
        "filter": frame.filter,
        "undistorted": frame.undistorted,
        "label": printable_label(frame),
        "overruled": list(frame.overruled),
        "warnings": list(frame.warnings),
    }


def printable_label(frame: Frame) -> dict[str, Any]:
    """The label as plain values; what JSON cannot hold becomes text."""
    label: dict[str, Any] = {}
    for key, value in list(frame.label.items())[:MAX_LABEL_VALUES]:
        try:
            label[str(key)] = plain(value)
        except TypeError:
            label[str(key)] = str(value)
    return label
