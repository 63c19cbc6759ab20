"""The images with ISDs by ALE, and CSM's formulas for them, with no code of the program."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import fsolve

from catalog.camera import Camera

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Case:
    """instrument: NAIF name or id. half_px: ALE's centre is half a pixel further than ISIS has it. centre_stated: the
    ISD states a centre. distortion_stated: the ISD holds the kernels' distortion."""

    instrument: str | int
    conditions: dict[str, Any]
    half_px: bool = False
    centre_stated: bool = True
    distortion_stated: bool = True
    metres: bool = False


CASES = {
    "EN1072174528M": Case("MSGR_MDIS_NAC", {"temperature_c": 4.07}),
    "f004a47": Case(-27001, {}, centre_stated=False),
    "f704b28": Case(-30002, {}, centre_stated=False),
    "N1702360370_1": Case("CASSINI_ISS_NAC", {"filter_name": "CL1/UV3"}),
    "E6I0032": Case("GLL_SSI_PLATFORM", {}, half_px=True),
    "c1637937": Case("VG1_ISSNA", {}),
    "c1638610": Case("VG1_ISSWA", {}),
    "c2065022": Case("VG2_ISSNA", {}),
    "c2065801": Case("VG2_ISSWA", {}),
    "lor_0034974380_0x630_sci_1": Case("NH_LORRI_1X1", {}, centre_stated=False, distortion_stated=False),
    # the addendum's 511.5 is the IK's, counted from 0; read as CSM's it lies half a pixel before
    "st_2458542208_v": Case("HAYABUSA_AMICA", {}, half_px=True, metres=True),
    "m0126888978f7_2p": Case("NEAR_MSI", {}, half_px=True, distortion_stated=False),
    "LUA3107H.161": Case("CLEM_UVVIS_A", {}, half_px=True, distortion_stated=False),
    "mpf_0295610274_0x539_sci": Case(-98903, {}, centre_stated=False),
    "JNCR_2016240_01M06152_V01": Case("JUNO_JUNOCAM", {}, half_px=True, distortion_stated=False),
    "CAS-MCO-2016-11-26T22.32.14.582-RED-01000-B1": Case("TGO_CASSIS", {}, half_px=True, distortion_stated=False),
}


def isd_of(data_folder: Path, name: str) -> tuple[Path, dict[str, Any]]:
    paths = [path for path in sorted((data_folder / "isd" / name).glob("*isd.json")) if "isis_isd" not in path.name]
    return paths[0], json.loads(paths[0].read_text())


def kernel_camera(data_folder: Path, name: str, isd: dict[str, Any]) -> Camera:
    case, kernels = CASES[name], data_folder / "isd" / name / "kernels"
    return Camera.from_kernels([kernels], case.instrument, isd["center_ephemeris_time"], **case.conditions)


def undistorted_mm(isd: dict[str, Any], mm: Array) -> Array:
    """CSM's formulas for one point."""
    (name, given), (x, y) = next(iter(isd["optical_distortion"].items())), mm
    if name == "radial":
        k = given["coefficients"]
        if len(k) == 1:  # ISIS' K1
            return mm * (1 + k[0] * (x * x + y * y))
        r2 = x * x + y * y
        return mm * (1 - k[0] - k[1] * r2 - k[2] * r2 * r2)
    if name == "transverse":

        def missed(u: Array) -> Array:
            a, b = u
            terms = np.array([1, a, b, a * a, a * b, b * b, a**3, a * a * b, a * b * b, b**3])
            return np.array([terms @ given["x"], terms @ given["y"]]) - mm

        return np.asarray(fsolve(missed, mm, xtol=1e-13))
    half = 0.5 * np.array([isd["image_samples"], isd["image_lines"]]) / abs(isd["focal2pixel_lines"][2])
    u, v = -mm / half
    p = [[np.polynomial.legendre.Legendre.basis(n)(at) for n in range(6)] for at in (u, v)]
    order = [(i, n - i) for n in range(1, 6) for i in range(n + 1)]
    shift = [
        sum(c * p[0][i] * p[1][j] for c, (i, j) in zip(given[f"{axis}_coefficients"], order, strict=True))
        for axis in "xy"
    ]
    return -(np.array([u, v]) + shift) * half


def csm_directions(isd: dict[str, Any], beyond_centre_px: Array, focal_length: float, distorted: bool) -> Array:
    """Unit vectors (n, 3) in the sensor's frame of detector pixels counted from the centre (n, 2)."""
    inverse = np.linalg.inv([isd["focal2pixel_samples"][1:], isd["focal2pixel_lines"][1:]])
    mm = beyond_centre_px @ inverse.T
    mm = np.array([undistorted_mm(isd, point) for point in mm]) if distorted else mm
    rays = np.column_stack([mm, np.full(len(mm), focal_length)])
    return rays / np.linalg.norm(rays, axis=1, keepdims=True)
