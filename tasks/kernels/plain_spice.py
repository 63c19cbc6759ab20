"""What plain SPICE says of pixels: SINCPT, ILUMIN and RECLAT with light time and aberration, in a process of its own.

Run as a script: a JSON request on stdin, the answer on stdout. It knows nothing of planetpose but the kernels' names:
`kernels` in the order of loading, `corrections`, and `exposures`, each with target, target_frame, spacecraft,
camera_frame, camera_id, et and xy_px (n, 2). The answer: for each exposure n rows of latitude, longitude (east, 0-360),
incidence, emission, phase (degrees) and range (km); null where a line misses.
"""

import json
import sys
from typing import Any

import spiceypy

Rows = list[list[float] | None]


def answer(request: dict[str, Any]) -> list[Rows]:
    """Rows for the pixels of each exposure, with the request's kernels loaded."""
    for kernel in request["kernels"]:
        spiceypy.furnsh(kernel)
    return [rows_of(exposure, request["corrections"]) for exposure in request["exposures"]]


def rows_of(request: dict[str, Any], corrections: str) -> Rows:
    """Rows for one exposure."""
    centre_x, centre_y = spiceypy.gdpool(f"INS{request['camera_id']}_CENTRE_PX", 0, 2)
    focal_length = float(spiceypy.gdpool(f"INS{request['camera_id']}_FOCAL_LENGTH_PX", 0, 1)[0])
    how = (request["target"], request["et"], request["target_frame"], corrections, request["spacecraft"])
    rows: Rows = []
    with spiceypy.no_found_check():
        for x, y in request["xy_px"]:
            ray = [(x - centre_x) / focal_length, (y - centre_y) / focal_length, 1.0]
            point, _, to_point, found = spiceypy.sincpt("ELLIPSOID", *how, request["camera_frame"], ray)
            if not found:
                rows.append(None)
                continue
            _, _, phase, incidence, emission = spiceypy.ilumin("ELLIPSOID", *how, point)
            _, longitude, latitude = spiceypy.reclat(point)
            degrees = [a * spiceypy.dpr() for a in (latitude, longitude, incidence, emission, phase)]
            rows.append([degrees[0], degrees[1] % 360.0, *degrees[2:], spiceypy.vnorm(to_point)])
    return rows


if __name__ == "__main__":
    json.dump(answer(json.load(sys.stdin)), sys.stdout)
