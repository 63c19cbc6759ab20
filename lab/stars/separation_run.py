"""`planetpose benchmark separation`: planted errors of camera and target, separated by the stars."""

import json
import shutil
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera, known_cameras
from catalog.pose import Pose
from catalog.rotation import vector_deg_from_rotation
from catalog.spice import kernel_pool
from catalog.target import find_target
from lab.stars.run import usable
from lab.stars.separation import Planted, write_separation_sequence

Array = NDArray[np.float64]
Row = dict[str, Any]
# Bars: across the sight, and of what plain SPICE reads from the kernels.
BAR_PX, BAR_KERNELS_DEG = 0.1, 2e-5
WRONG_SIGMAS = 3.0
# Shorter focal lengths, in pixels, would need Europa nearer than its planet is for it to be this large.
SHORTEST_FOCAL_PX = 9000.0
RADII_PX = (28.0, 60.0)


@dataclass(frozen=True)
class Case:
    """One frame. like: the camera whose focal length and blur it has."""

    like: Camera
    seed: int
    radius_px: float


def cases(count: int, seed: int) -> Iterator[Case]:
    """As many, over the cameras by turns."""
    fit = [each for each in known_cameras().values() if usable(each) and each.focal_length_px >= SHORTEST_FOCAL_PX]
    random = np.random.default_rng(seed)
    order = random.permutation(len(fit))
    for number in range(count):
        radius_px = float(random.uniform(*RADII_PX))
        yield Case(fit[order[number % len(fit)]], seed * 1_000_003 + number, radius_px)


def do(case: Case) -> Row:
    """Draw a frame, correct it from its files, and compare."""
    from flows.one_image import one_result
    from flows.progress import Silent
    from flows.request import Request
    from tasks.step import run

    folder = Path(tempfile.mkdtemp(prefix="separation-"))
    try:
        (planted,) = write_separation_sequence(
            folder, case.seed, 1, radius_px=case.radius_px, as_mapped=False, like=case.like
        )
        files = planted.files
        request = Request(
            image=files["image"], camera=str(files["camera"]), target="europa", pose_file=files["pose"], kernels=(),
            stars=str(files["catalog"]), store=folder / "out", cache=folder / "cache",
        )  # fmt: skip
        result = one_result(request, Silent(), run_step=run)
        row: Row = {"camera": case.like.name, "radius_px": case.radius_px}
        row |= {"offset_km": float(np.linalg.norm(planted.offset_km))}
        row |= {"status": result["status"], "reason": result["reason"]}
        content: Row = json.loads(json.dumps(row | compared(result, planted, folder)))
        return content
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def compared(result: Row, planted: Planted, folder: Path) -> Row:
    """Errors of the target's offset across the sight (error_px; z: over their stated 1-sigma, along the picture's x and
    y) and of the camera's boresight (camera_error_px), and how far plain SPICE is from the result (kernels_deg)."""
    found = result.get("stars") or {}
    if found.get("target_offset_km") is None:
        return {"error_px": None}
    truth, focal_px = planted.pose, planted.camera.focal_length_px
    turn = truth.camera_from_j2000
    across = (turn @ (np.array(found["target_offset_km"]) - planted.offset_km))[:2]
    covariance = turn @ np.array(found["target_offset_covariance_km2"]) @ turn.T
    camera_off = vector_deg_from_rotation(np.array(result["pose"]["camera_from_j2000"]) @ turn.T)
    return {
        "stars": int(found["stars"]),
        "error_px": float(np.hypot(*across) / truth.range_km * focal_px),
        "z": (across / np.sqrt(np.diag(covariance)[:2])).tolist(),
        "camera_error_px": float(np.radians(np.hypot(*camera_off[:2])) * focal_px),
        "camera_roll_deg": float(abs(camera_off[2])),
        "kernels_deg": kernels_off_deg(Pose.from_dict(result["pose"]), planted.camera, folder / "kernels"),
    }


def kernels_off_deg(pose: Pose, camera: Camera, folder: Path) -> float:
    """By how much plain SPICE, with the CK and the SPK that are written of a pose, has the camera's orientation or the
    target's direction elsewhere, whichever is more."""
    import spiceypy

    from tasks.kernels.exposure import Exposure
    from tasks.kernels.write import write_kernel_set

    folder.mkdir(exist_ok=True)
    exposure = Exposure("separation", camera, find_target("europa"), pose, 0.5)
    with kernel_pool([]) as loaded:
        kernel_set = write_kernel_set("separation", [exposure], folder, loaded)
    names = kernel_set.names_of(exposure)
    with kernel_pool([kernel_set.meta_kernels["alone"]]):
        turned = np.asarray(spiceypy.pxform("J2000", names["camera_frame"], pose.et))
        seen, _ = spiceypy.spkpos(names["target"], pose.et, "J2000", "LT+S", names["spacecraft"])
    along = np.asarray(seen) / np.linalg.norm(seen)
    off = np.degrees(np.linalg.norm(along - pose.target_from_spacecraft_km / pose.range_km))
    return float(max(off, np.linalg.norm(vector_deg_from_rotation(turned @ pose.camera_from_j2000.T))))


def separation_summary(rows: list[Row]) -> Row:
    """Figures over all frames."""
    measured = [row for row in rows if row["error_px"] is not None]
    sound = [row for row in measured if row["status"] == "ok"]
    errors = np.array([row["error_px"] for row in sound])
    z = np.abs([row["z"] for row in sound]).reshape(-1, 2)
    return {
        "frames": len(rows),
        "ok": sum(row["status"] == "ok" for row in rows),
        "wrong_ok": sum(row["error_px"] > BAR_PX and max(map(abs, row["z"])) > WRONG_SIGMAS for row in sound),
        "error_px_median": float(np.median(errors)) if len(errors) else None,
        "error_px_worst": float(errors.max()) if len(errors) else None,
        "beyond_bar": int((errors > BAR_PX).sum()),
        "within_1_sigma": float((z <= 1).mean()) if len(z) else None,
        "within_2_sigma": float((z <= 2).mean()) if len(z) else None,
        "kernels_deg_worst": max((row["kernels_deg"] for row in measured), default=None),
    }
