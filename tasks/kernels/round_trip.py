"""Whether plain SPICE, in a second process, says of a kernel set what the cubes say."""

import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.errors import FailedError
from catalog.reasons import Reason
from tasks.kernels import plain_spice
from tasks.kernels.exposure import Exposure
from tasks.kernels.write import KernelSet
from tasks.project.backplanes import ANGLES
from tasks.project.pixels import project_pixels

Array = NDArray[np.float64]
CORRECTIONS = "CN+S"  # converged; LT+S leaves up to 2e-4 deg at light times of 10 s


def spice_planes(
    kernels: Sequence[Path], exposures_given: Sequence[dict[str, Any]], corrections: str = CORRECTIONS
) -> list[dict[str, Array]]:
    """ANGLES and range_km (n,) by plain SPICE in a second process, which loads `kernels` in order.

    exposures_given: for each exposure the names of `KernelSet.names_of`, et and xy_px (n, 2). NaN where SPICE's line
    misses the body. Raises FailedError with its words when SPICE fails.
    """
    exposures = [{**one, "xy_px": np.asarray(one["xy_px"], dtype=float).tolist()} for one in exposures_given]
    request = {"kernels": [str(path) for path in kernels], "corrections": corrections, "exposures": exposures}
    done = subprocess.run(
        [sys.executable, "-P", plain_spice.__file__],
        input=json.dumps(request),
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode != 0:
        fault = " ".join(done.stderr.split())[-500:]
        raise FailedError(
            Reason.SPICE_FAILED, f"plain SPICE cannot use the kernels: {fault}", "Look at the left-out list."
        )
    return [_columns(rows) for rows in json.loads(done.stdout)]


def _columns(rows: list[list[float] | None]) -> dict[str, Array]:
    nothing = [np.nan] * (len(ANGLES) + 1)
    table = np.array([nothing if row is None else row for row in rows], dtype=float).reshape(-1, len(nothing))
    return dict(zip((*ANGLES, "range_km"), table.T, strict=True))


def largest_difference_deg(ours: dict[str, Array], theirs: dict[str, Array]) -> dict[str, float]:
    """By plane of ANGLES, longitudes along the parallel; infinite when the two see the body at different pixels."""
    if not np.array_equal(np.isfinite(ours["latitude"]), np.isfinite(theirs["latitude"])):
        return dict.fromkeys(ANGLES, float("inf"))
    found = {}
    for name in ANGLES:
        off = np.abs((ours[name] - theirs[name] + 180) % 360 - 180)
        off = off * np.cos(np.radians(ours["latitude"])) if name == "longitude" else off
        found[name] = float(np.nanmax(off)) if np.isfinite(off).any() else 0.0
    return found


def round_trip(
    kernel_set: KernelSet,
    exposures: Sequence[Exposure],
    kind: str,
    mission_kernels: Sequence[Path] = (),
    pixels: int = 100,
    corrections: str = CORRECTIONS,
) -> list[dict[str, float]]:
    """For each exposure the largest differences between the projection and plain SPICE, by plane, degrees, over random
    pixels of the disk. kind: `alone`, or `mission` after mission_kernels."""
    places = [_pixels_of_disk(e, pixels) for e in exposures]
    exposures_given = [
        {**kernel_set.names_of(e), "et": e.pose.et, "xy_px": xy} for e, xy in zip(exposures, places, strict=True)
    ]
    kernels = [*(mission_kernels if kind == "mission" else ()), kernel_set.meta_kernels[kind]]
    theirs = spice_planes(kernels, exposures_given, corrections)
    return [
        largest_difference_deg(project_pixels(e.pose, e.camera, e.target, xy), found)
        for e, xy, found in zip(exposures, places, theirs, strict=True)
    ]


def _pixels_of_disk(exposure: Exposure, count: int) -> Array:
    """Random whole pixels of the frame that see the target; the frame's own when few do."""
    from tasks.project.planes import project_planes

    planes = project_planes(exposure.pose, exposure.camera, exposure.target, planes=("latitude",))
    rows, columns = np.nonzero(planes.on_body)
    if not len(rows):
        rows, columns = np.nonzero(~planes.on_body)
    chosen = np.random.default_rng(0).choice(len(rows), min(count, len(rows)), replace=False)
    return np.stack([columns[chosen], rows[chosen]], axis=-1).astype(np.float64)
