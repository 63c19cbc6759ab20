"""SPICE's own answer for a pose: synthetic kernels that hold exactly its vectors, and the loop people write today.

Kernels: one SPK with spacecraft and Sun at rest relative to the target, a text kernel with names, radii and the
body-fixed frame as a fixed offset (TK) from J2000. Aberration correction NONE, since a pose's vectors are corrected.
"""

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catalog.camera import Camera
from catalog.pose import Pose
from catalog.target import Target

BODY_ID, SPACECRAFT_ID, FRAME_ID, SUN_ID = 2999001, -999001, 1999001, 10
BODY, SPACECRAFT, FRAME = "PLANETPOSE_BODY", "PLANETPOSE_CRAFT", "PLANETPOSE_BODY_FIXED"
HALF_SPAN_S = 1e5

TEXT_KERNEL = """KPL/FK
\\begindata
NAIF_BODY_NAME += ( '{body}', '{craft}' )
NAIF_BODY_CODE += ( {body_id}, {craft_id} )
BODY{body_id}_RADII = ( {radii} )
FRAME_{frame} = {frame_id}
FRAME_{frame_id}_NAME = '{frame}'
FRAME_{frame_id}_CLASS = 4
FRAME_{frame_id}_CLASS_ID = {frame_id}
FRAME_{frame_id}_CENTER = {body_id}
TKFRAME_{frame_id}_RELATIVE = 'J2000'
TKFRAME_{frame_id}_SPEC = 'MATRIX'
TKFRAME_{frame_id}_MATRIX = ( {matrix} )
\\begintext
"""


def write_kernels(pose: Pose, target: Target, folder: Path) -> list[Path]:
    """Write the two kernels into `folder`. Call inside `catalog.spice.kernel_pool`, which holds SPICE's lock."""
    text = folder / "pose.tf"
    lines = {"radii": _column(np.asarray(target.radii_km)), "matrix": _column(pose.body_from_j2000)}
    ids = {"body_id": BODY_ID, "craft_id": SPACECRAFT_ID, "frame_id": FRAME_ID}
    text.write_text(TEXT_KERNEL.format(body=BODY, craft=SPACECRAFT, frame=FRAME, **ids, **lines))
    trajectory = folder / "pose.bsp"
    _write_trajectory(trajectory, pose)
    return [text, trajectory]


def _column(values: NDArray[np.float64]) -> str:
    return "\n  ".join(f"{v:.17g}" for v in values.ravel())


def _write_trajectory(path: Path, pose: Pose) -> None:
    import spiceypy

    first, last = pose.et - HALF_SPAN_S, pose.et + HALF_SPAN_S
    at_rest = {SPACECRAFT_ID: -pose.target_from_spacecraft_km, SUN_ID: pose.sun_from_target_km}
    handle = spiceypy.spkopn(str(path), "planetpose", 0)
    for body, position in at_rest.items():
        states = np.tile(np.concatenate([position, np.zeros(3)]), (2, 1))
        spiceypy.spkw08(handle, body, BODY_ID, "J2000", first, last, "at rest", 1, 2, states, first, last - first)
    states = np.zeros((2, 6))
    spiceypy.spkw08(handle, BODY_ID, 0, "J2000", first, last, "at rest", 1, 2, states, first, last - first)
    spiceypy.spkcls(handle)


def project_with_spice(pose: Pose, camera: Camera, xy_px: ArrayLike) -> NDArray[np.float64]:
    """Latitude, longitude, incidence, emission and phase (n, 5), degrees, of pixels (n, 2) by SINCPT, ILUMIN and
    RECLAT, one after the other; NaN off the body. The kernels of `write_kernels` must be loaded."""
    import spiceypy

    rays = camera.ray(xy_px) @ pose.camera_from_j2000
    angles = np.full((len(rays), 5), np.nan)
    with spiceypy.no_found_check():
        for ray, row in zip(rays, angles, strict=True):
            point, _, _, found = spiceypy.sincpt("ELLIPSOID", BODY, pose.et, FRAME, "NONE", SPACECRAFT, "J2000", ray)
            if not found:
                continue
            _, _, phase, incidence, emission = spiceypy.ilumin(
                "ELLIPSOID", BODY, pose.et, FRAME, "NONE", SPACECRAFT, point
            )
            _, longitude, latitude = spiceypy.reclat(point)
            row[:] = latitude, longitude, incidence, emission, phase
    return np.degrees(angles)
