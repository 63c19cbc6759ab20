"""Poses that files carry: ISDs, tables of ISIS cubes, PDS4 geometry, and orientations in headers and labels."""

from pathlib import Path

from catalog.camera import Camera
from catalog.celestial import REVERSED_ROWS, orientation_of_wcs, twist_fault, twist_of_label
from catalog.errors import RefusedError
from catalog.flips import Flip
from catalog.isd import is_isd, pose_from_isd
from catalog.isis_tables import cube_label, has_pose, is_isis_cube, pose_from_cube
from catalog.observation import Frame
from catalog.packed import readable
from catalog.pds4_geometry import pds4_label_beside, pose_from_pds4
from catalog.plain_files import read_json_file
from catalog.pose import PartialPose, read_pose_file
from catalog.target import Target

TWIST_FORMATS = ("galileo-redr",)
Faults = tuple[str, ...]


def parts_of_pose_file(path: Path | None, target: Target | None = None) -> tuple[str, PartialPose]:
    """Name of the source (`file`, or `isd` for an ISD) and the parts that it gives. Raises RefusedError naming the file
    and its fault."""
    if path is None:
        return "file", PartialPose()
    try:
        content = read_json_file(path)
    except (OSError, ValueError):
        content = None  # `read_pose_file` says what is wrong
    return ("isd", pose_from_isd(path, target)) if is_isd(content) else ("file", read_pose_file(path))


def parts_of_tables(frame: Frame, et: float) -> tuple[PartialPose, Faults]:
    """The parts in the tables of an ISIS cube after spiceinit, and why there are none where the tables do not serve."""
    try:
        with readable(frame.path) as cube:
            if not is_isis_cube(cube):
                return PartialPose(), ()
            label = cube_label(cube)
            if not has_pose(label):
                return PartialPose(), ("the cube has no tables of spiceinit",)
            return pose_from_cube(cube, et, label), ()
    except RefusedError as error:
        return PartialPose(), (error.fault,)


def parts_of_pds4(frame: Frame, camera: Camera, flip: Flip | None) -> tuple[PartialPose, Faults]:
    """The parts in the geometry classes of a PDS4 label, the file's own or one beside it."""
    label = pds4_label_beside(frame.path)
    if label is None:
        return PartialPose(), ()
    lines, samples = frame.mode.shape or frame.observation.image.shape
    is_reversed = bool(frame.label.get(REVERSED_ROWS))
    return pose_from_pds4(label, camera, (samples, lines), flip, is_reversed, frame.mode.first_px)


def orientation_of_header(
    frame: Frame, camera: Camera, target: Target, et: float, flip: Flip | None
) -> tuple[PartialPose, str, Faults]:
    """The camera's orientation by RA, DEC and TWIST of a Galileo label, or by a FITS header's world coordinates; its
    source (`twist` or `wcs`); and why it is not used."""
    if frame.format in TWIST_FORMATS:
        turned = twist_of_label(frame.label)
        fault = None if turned is None else twist_fault(frame.label, turned, target, et)
        return PartialPose(camera_from_j2000=None if fault else turned), "twist", (fault,) if fault else ()
    lines, samples = frame.mode.shape or frame.observation.image.shape
    try:
        turned = orientation_of_wcs(frame.label, camera, (samples, lines), flip, frame.mode.first_px)
    except RefusedError as error:
        return PartialPose(), "wcs", (error.fault,)
    return PartialPose(camera_from_j2000=turned), "wcs", ()
