"""Poses in PDS4 labels: the geometry dictionary's Object_Orientation_RA_Dec and its position vectors.

Labels are in use whose vectors have every sign reversed, so vectors only count where the label's own right ascension
and declination have the target in front of the camera.
"""

import math
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from catalog.celestial import orientation_of_twist
from catalog.detached import PDS4_SUFFIXES, label_beside
from catalog.errors import RefusedError
from catalog.flips import Flip
from catalog.pose import PartialPose
from catalog.readers.pds4 import parsed_xml
from catalog.rotation import rotation_from_vector_deg

if TYPE_CHECKING:
    from catalog.camera import Camera

Vector = NDArray[np.float64]
Element = ElementTree.Element
UNIT_KM = {"km": 1.0, "m": 1e-3, "AU": 149597870.7}
OUTSIDE_DEG = 5.0  # a target of which only the limb is in the picture may have its centre this far outside


def pose_from_pds4(
    path: Path,
    camera: "Camera",
    size_px: tuple[int, int],
    flip: Flip | None,
    is_reversed: bool = False,
    first_px: tuple[int, int] = (0, 0),
) -> tuple[PartialPose, tuple[str, ...]]:
    """The parts of the pose in a PDS4 label file, and why there are no others. size_px: of the picture as it was read;
    flip, is_reversed: whether the user or the reader turned its lines; first_px: where its first pixel lies in the
    camera's frame."""
    try:
        root = parsed_xml(path, path)
    except (OSError, RefusedError) as error:
        why = error.fault if isinstance(error, RefusedError) else str(error)
        return PartialPose(), (f"PDS4 label {path.name} cannot be read ({why})",)
    found = next(root.iter("Object_Orientation_RA_Dec"), None)
    if found is None:
        return PartialPose(), ("the PDS4 label has no Object_Orientation_RA_Dec",)
    if (found.findtext("reference_pixel_location") or "Center").strip().lower() != "center":
        return PartialPose(), ("the PDS4 label's orientation is not that of the picture's centre",)
    if not _is_j2000(found):
        return PartialPose(), ("the PDS4 label's orientation is not said to be in J2000",)
    keys = ("right_ascension_angle", "declination_angle", "celestial_north_clock_angle")
    ra, dec, clock = (_number(found, key) for key in keys)
    if ra is None or dec is None or not -90 <= dec <= 90:
        return PartialPose(), ("the PDS4 label's orientation has no right ascension and declination",)
    middle = orientation_of_twist(ra, dec, 0.0)[2]
    fault = _display_fault(root, flip, is_reversed)
    if clock is None:
        fault = "the PDS4 label does not give the celestial north's clock angle"
    turned = None
    if clock is not None and fault is None:
        ray = camera.detector_ray((np.array(size_px, dtype=np.float64) - 1) / 2 + first_px)
        turned = _from_axis_to(ray) @ orientation_of_twist(ra, dec, 270.0 - clock)
    corners = camera.detector_ray(np.array([[0.0, 0.0], [size_px[0] - 1.0, size_px[1] - 1.0]]) + first_px)
    target, sun, vector_fault = _positions(root, middle, corners)
    faults = tuple(each for each in (fault, vector_fault) if each)
    return (
        PartialPose(camera_from_j2000=turned, target_from_spacecraft_km=target, sun_from_target_km=sun),
        faults,
    )


def pds4_label_beside(path: Path) -> Path | None:
    """The PDS4 label of a file: itself, or the one beside it."""
    label = path if path.suffix.lower() in PDS4_SUFFIXES else label_beside(path)
    return label if label is not None and label.suffix.lower() in PDS4_SUFFIXES else None


def _positions(root: Element, middle: Vector, corners: Vector) -> tuple[Vector | None, Vector | None, str | None]:
    """target_from_spacecraft_km, sun_from_target_km and what is wrong with them. middle, corners (2, 3): directions of
    the picture's centre and of two opposite corners."""
    target = _vector(root, "Vector_Cartesian_Position_Spacecraft_To_Target")
    if target is None:
        return None, None, "the PDS4 label has no position of the target in kilometres in J2000"
    half_field = math.degrees(math.acos(float(np.clip(corners[0] @ corners[1], -1, 1)))) / 2
    off = math.degrees(math.acos(float(np.clip(middle @ target / np.linalg.norm(target), -1, 1))))
    if off > half_field + OUTSIDE_DEG:
        return None, None, f"the PDS4 label has the target {off:.0f} deg from where it has the camera look"
    sun_to_target = _vector(root, "Vector_Cartesian_Position_Sun_To_Target")
    sun_to_spacecraft = _vector(root, "Vector_Cartesian_Position_Sun_To_Spacecraft")
    if sun_to_target is None and sun_to_spacecraft is not None:
        sun_to_target = sun_to_spacecraft + target
    if sun_to_target is None:
        return target, None, "the PDS4 label has no position of the Sun"
    return target, -sun_to_target, None


def _vector(root: Element, name: str) -> Vector | None:
    found = next(root.iter(name), None)
    if found is None or not _is_j2000(found, unsaid=True):
        return None
    values = [_number(found, f"{axis}_position", UNIT_KM) for axis in "xyz"]
    known = [value for value in values if value is not None]
    return np.array(known) if len(known) == 3 and any(known) else None


def _is_j2000(element: Element, unsaid: bool = False) -> bool:
    """Whether the frame named in an element is J2000. unsaid: the answer where none is named."""
    places = ("Reference_Frame_Identification", "Coordinate_System_Identification")
    named = [each for place in places for each in element.iter(place)]
    names = [name.text or "" for each in named for name in each if name.tag in ("name", "frame_spice_name")]
    return all("J2000" in name.upper() or "ICRF" in name.upper() for name in names) if names else unsaid


def _display_fault(root: Element, flip: Flip | None, is_reversed: bool) -> str | None:
    """Why the picture does not lie as the label has it displayed, to which its clock angles refer; None if it does."""
    vertical, horizontal = (
        next((each.text or "" for each in root.iter(f"{name}_display_direction")), usual).strip().lower()
        for name, usual in (("vertical", "Top to Bottom"), ("horizontal", "Left to Right"))
    )
    is_upward = {"top to bottom": False, "bottom to top": True}.get(vertical)
    is_turned = (flip == "y") != is_reversed
    if horizontal == "left to right" and flip in (None, "y") and is_upward is is_turned:
        return None
    return f"the PDS4 label has the picture displayed {horizontal}, {vertical}; it was read otherwise (see --flip)"


def _from_axis_to(ray: Vector) -> Vector:
    """The smallest rotation (3, 3) that takes +Z to a direction."""
    axis = np.cross([0.0, 0.0, 1.0], ray)
    sine = float(np.linalg.norm(axis))
    if sine == 0.0:
        return np.eye(3)
    return rotation_from_vector_deg(axis / sine * math.degrees(math.atan2(sine, float(ray[2]))))


def _number(element: Element, name: str, units: dict[str, float] | None = None) -> float | None:
    found = element.find(name)
    try:
        value = float((found.text or "") if found is not None else "")
    except ValueError:
        return None
    factor = 1.0 if units is None or found is None else units.get(found.get("unit", "km"))
    return value * factor if factor is not None and math.isfinite(value) else None
