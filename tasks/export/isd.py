"""Products as image support data (ISD) for USGS' Community Sensor Model."""

import json
from pathlib import Path
from typing import Any

from catalog.isd_writing import detector_isd, undistorted_isd
from catalog.optics import RESEAU
from tasks.atomic import file_put_in_place
from tasks.export.source import Source


def write_isd(source: Source, path: Path) -> Path:
    """Write the ISD of the corrected pose and the undistorted frame, and return `path`; beside it, `..._detector.json`,
    that of the raw detector with its distortion, except where the distortion is measured on the marks of each image."""
    _write(undistorted_isd(source.camera, source.pose, source.target) | _origin(source, "undistorted frame"), path)
    if source.camera.distortion.model != RESEAU:
        content, residual_px = detector_isd(source.camera, source.pose, source.target)
        about = _origin(source, f"detector; its distortion to {residual_px:.2g} px")
        _write(content | about, path.with_name(f"{path.stem}_detector.json"))
    return path


def _origin(source: Source, frame: str) -> dict[str, Any]:
    return {"planetpose": {"product": source.product, "frame": frame, "utc": source.attributes.get("utc", "")}}


def _write(content: dict[str, Any], path: Path) -> None:
    with file_put_in_place(path) as temporary:
        temporary.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
