"""The paper's own published result: geometry of 57 images of Europa, corrected by its authors.

Belgacem et al. 2020, data structure `data_EUR` of its supplement: `europa57.csv` holds its numbers
in this program's conventions. Converted from ECLIPJ2000 metres to J2000 kilometres; Rcam's columns were the camera's
axes (sample, line, boresight), moon_att led from the body to ECLIPJ2000; Sun_pos was relative to the spacecraft. The
quaternions (scalar last) are camera_from_j2000 and body_from_j2000.

Measured against SPICE (LT+S, kernels of the data folder): LORRI ranges agree to 3.7 km and directions to 1.4 microrad;
the Voyager positions of the paper differ from vgr1/2_jup230 by 50 to 620 km (before its range factor).
"""

import csv
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from catalog.pose import Pose

CSV_FILE = Path(__file__).parent / "europa57.csv"


@dataclass(frozen=True)
class PaperImage:
    """One image. pose: corrected. range_factor: the paper's kdist, already part of the pose."""

    image: str
    camera: str
    exposure_s: float
    range_factor: float
    pose: Pose


@cache
def paper_images() -> dict[str, PaperImage]:
    """The 57 images by name: 18 LORRI, 14 Voyager 1 NAC, 16 Voyager 2 NAC, 9 Voyager 2 WAC."""
    with CSV_FILE.open(newline="") as file:
        return {row["image"]: _paper_image(row) for row in csv.DictReader(file)}


def _paper_image(row: dict[str, str]) -> PaperImage:
    from scipy.spatial.transform import Rotation

    def numbers(prefix: str, axes: str, suffix: str = "") -> np.ndarray:
        return np.array([float(row[f"{prefix}{axis}{suffix}"]) for axis in axes])

    pose = Pose(
        et=float(row["et"]),
        camera_from_j2000=Rotation.from_quat(numbers("camera_q", "xyzw")).as_matrix(),
        target_from_spacecraft_km=numbers("target_", "xyz", "_km"),
        sun_from_target_km=numbers("sun_", "xyz", "_km"),
        body_from_j2000=Rotation.from_quat(numbers("body_q", "xyzw")).as_matrix(),
    )
    return PaperImage(row["image"], row["camera"], float(row["exposure_s"]), float(row["range_factor"]), pose)
