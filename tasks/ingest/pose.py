"""The pose that the metadata claim, each part from the best source that knows it: pose file (or ISD), SPICE, the
tables of an ISIS cube, label.

One exception: an orientation that was built from a label's scalars (centre line and sample, north azimuth) only means
something together with the label's own distance and sub-spacecraft point, so then every part but the Sun is
the label's.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from catalog.camera import Camera
from catalog.errors import RefusedError
from catalog.flips import Flip
from catalog.observation import Frame
from catalog.pose import POSE_KEYS, VELOCITY_KEYS, PartialPose, Pose
from catalog.reasons import Reason
from catalog.spacecraft_clock import et_by_clock
from catalog.spice import Kernel, kernel_pool
from catalog.spice_pose import LIGHT_KM_PER_S, pose_parts_from_loaded
from catalog.target import Target
from catalog.times import utc_from_et
from tasks.bodies.placed import DEFAULTS
from tasks.ingest.bodies import bodies_of_image, candidates_for
from tasks.ingest.carried import orientation_of_header, parts_of_pds4, parts_of_pose_file, parts_of_tables
from tasks.simulate.others import OtherBodiesSettings

# Labels state start, middle or readout of an exposure; missions' clocks differ from ALE's by up to some seconds.
SAME_EXPOSURE_S = 60.0
IN_IMAGE_TOO = "Where a quarter of the limb or more is in the frame, the pose can be found in the image: --pose image."


@dataclass(frozen=True)
class InitialPose:
    """pose: the complete predicted pose. source: where the camera's orientation came from (file, spice, label).

    sources: the same for each part (also `isd`; `tables` of an ISIS cube; `pds4`, geometry of its label; `wcs` and
    `twist`, orientations of headers and labels; `catalog`: rotation model of the target file). missing: what SPICE
    could not give, in words. kernels: name and sha256 of what was furnished. evidence: range_km by each source that
    has one. errors: 1-sigma errors that the pose file states of its own parts.
    """

    pose: Pose
    source: str
    sources: dict[str, str]
    missing: tuple[str, ...] = ()
    kernels: tuple[dict[str, str], ...] = ()
    evidence: dict[str, Any] = field(default_factory=dict)
    errors: dict[str, float] = field(default_factory=dict)


def initial_pose(
    frame: Frame,
    camera: Camera,
    target: Target,
    kernels: Iterable[Path],
    pose_file: Path | None = None,
    flip: Flip | None = None,
    bodies: Sequence[str] = (),
    others: OtherBodiesSettings = DEFAULTS,
) -> InitialPose:
    """Predicted pose of `frame` at mid-exposure.

    Precedence of each part: pose file or ISD, SPICE where `kernels` (files or folders) cover it, the tables of an ISIS
    cube, label, geometry of a PDS4 label, header. The pose file's time overrides the label's. flip: how the user had
    the picture flipped. bodies: names of the other bodies to place; others: which of them count, see `bodies_of_image`.

    Raises RefusedError `pose-unknown` naming the parts, the missing kernels and the remedy.
    """
    kernels = list(kernels)
    candidates = candidates_for(bodies, target, kernels)
    with kernel_pool(kernels) as loaded:
        found, from_file = _initial_pose(frame, camera, target, loaded, pose_file, flip)
        placed = bodies_of_image(found.pose, camera, target, from_file.bodies, candidates, pose_file, others)
    return replace(found, pose=found.pose.replaced(bodies=placed))


def _initial_pose(
    frame: Frame, camera: Camera, target: Target, loaded: list[Kernel], pose_file: Path | None, flip: Flip | None
) -> tuple[InitialPose, PartialPose]:
    """The predicted pose without other bodies, and what the pose file says."""
    kind, from_file = parts_of_pose_file(pose_file, target)
    if kind == "isd":
        _refuse_other_exposure(frame, from_file, pose_file)
    clock_faults: tuple[str, ...] = ()
    et = _first_known(from_file.et, frame.label_pose.et)
    if et is None:
        et, clock_faults = _time_of_frame(frame, camera, loaded)
    if et is None:
        why = f"{frame.product}: the label gives no time"
        raise RefusedError(
            Reason.POSE_UNKNOWN,
            f"{why} of the exposure: {frame.unclear['time']}." if "time" in frame.unclear else f"{why}.",
            "Give a pose file (--pose) with utc or et of mid-exposure, "
            f"and what no kernel gives of {', '.join(POSE_KEYS)}. {IN_IMAGE_TOO}",
        )
    from_label, is_relative, label_faults = _label_parts(frame, camera, target, et)
    tables, table_faults = parts_of_tables(frame, et)
    header, header_source, header_faults = orientation_of_header(frame, camera, target, et, flip)
    pds4, pds4_faults = parts_of_pds4(frame, camera, flip)
    label_faults += clock_faults + table_faults + pds4_faults + header_faults
    light_time_s = _light_time_s(from_file, tables, from_label, pds4)
    spice = pose_parts_from_loaded(camera, target, et, loaded, light_time_s)
    known_elsewhere = [part.camera_from_j2000 is not None for part in (from_file, spice.parts, tables)]
    relative_label = is_relative and not any(known_elsewhere)
    # Only the Sun does not hang on how the label has the target, and SPICE knows it better than the label's digits.
    from_spice = PartialPose(sun_from_target_km=spice.parts.sun_from_target_km) if relative_label else spice.parts
    ranked = {kind: from_file, "spice": from_spice, "tables": tables, "label": from_label, "pds4": pds4}
    ranked[header_source] = header
    parts, sources = _best_parts(ranked)
    parts = replace(parts, et=et)
    if sources.get("target_from_spacecraft_km") == "label":  # its own velocities, or SPICE's, serve as well
        parts = _with_velocities(parts, spice.parts)
    if parts.body_from_j2000 is None:
        parts = _with_catalog_rotation(parts, target, sources)
    unknown = [key for key in POSE_KEYS if getattr(parts, key) is None]
    if unknown:
        raise _unknown(frame, camera, unknown, spice.missing, label_faults)
    found = InitialPose(
        pose=parts.completed(),
        source=sources["camera_from_j2000"],
        sources=sources,
        missing=(*spice.missing, *label_faults),
        kernels=tuple(kernel.provenance() for kernel in spice.kernels) if "spice" in sources.values() else (),
        evidence={"range_km": _ranges({**ranked, "spice": spice.parts})},
        errors=dict(from_file.errors),
    )
    return found, from_file


def _refuse_other_exposure(frame: Frame, isd: PartialPose, path: Path | None) -> None:
    """An ISD is of one image: RefusedError where the label's time is another."""
    if frame.et is None or isd.et is None or abs(frame.et - isd.et) <= SAME_EXPOSURE_S:
        return
    fault = f"ISD {path} is of {utc_from_et(isd.et)}, image {frame.path} of {utc_from_et(frame.et)}."
    raise RefusedError(Reason.ISD_INVALID, fault, "Give the ISD of this image.")


def _first_known(*values: float | None) -> float | None:
    return next((value for value in values if value is not None), None)


def _time_of_frame(frame: Frame, camera: Camera, loaded: list[Kernel]) -> tuple[float | None, tuple[str, ...]]:
    """Mid-exposure by the spacecraft's clock, where the camera's file says that it is better and the kernels have it,
    else the label's; and why it is not the clock's."""
    if not loaded:
        return frame.et, ()
    et, fault = et_by_clock(camera.clock, frame.label, frame.exposure_s, camera.naif_spacecraft_id, frame.et)
    return _first_known(et, frame.et), (fault,) if fault else ()


def _label_parts(frame: Frame, camera: Camera, target: Target, et: float) -> tuple[PartialPose, bool, tuple[str, ...]]:
    """The label's parts, whether its orientation is relative to the label's own target geometry, and its faults."""
    if not frame.label_geometry:
        return frame.label_pose, False, ()
    from catalog.label_geometry import pose_from_label_geometry

    try:
        solved = pose_from_label_geometry(frame.label_geometry, camera, target, et)
    except RefusedError as error:  # other sources may do without the label
        return frame.label_pose, False, (f"label: {error.fault}",)
    return frame.label_pose.filled_from(solved), frame.label_pose.camera_from_j2000 is None, ()


def _light_time_s(*sources: PartialPose) -> float | None:
    positions = (source.target_from_spacecraft_km for source in sources)
    return next((float(np.linalg.norm(p)) / LIGHT_KM_PER_S for p in positions if p is not None), None)


def _best_parts(ranked: dict[str, PartialPose]) -> tuple[PartialPose, dict[str, str]]:
    parts = PartialPose()
    for candidate in ranked.values():
        parts = parts.filled_from(candidate)
    sources = {}
    for key in POSE_KEYS:
        known_to = [name for name, candidate in ranked.items() if getattr(candidate, key) is not None]
        sources.update({key: known_to[0]} if known_to else {})
    return parts, sources


def _with_velocities(parts: PartialPose, other: PartialPose) -> PartialPose:
    if parts.spacecraft_velocity_km_s is not None:
        return parts
    return replace(parts, **{key: getattr(other, key) for key in VELOCITY_KEYS})


def _with_catalog_rotation(parts: PartialPose, target: Target, sources: dict[str, str]) -> PartialPose:
    """Body attitude from the target file's rotation model at the time the light left, when the range is known."""
    light_time_s = _light_time_s(parts)
    if target.rotation is None or light_time_s is None or parts.et is None:
        return parts
    sources["body_from_j2000"] = "catalog"
    return replace(parts, body_from_j2000=target.rotation.body_from_j2000(parts.et - light_time_s))


def _ranges(ranked: dict[str, PartialPose]) -> dict[str, float]:
    positions = {name: parts.target_from_spacecraft_km for name, parts in ranked.items()}
    return {name: float(np.linalg.norm(p)) for name, p in positions.items() if p is not None}


def _unknown(
    frame: Frame, camera: Camera, unknown: list[str], spice_gaps: tuple[str, ...], label_faults: tuple[str, ...]
) -> RefusedError:
    needed = f" Kernels of {camera.name}: {'; '.join(camera.kernels)}." if camera.kernels else ""
    label = "; ".join(label_faults) or f"the label does not give them for {frame.target}"
    return RefusedError(
        Reason.POSE_UNKNOWN,
        f"{frame.product}: {', '.join(unknown)} unknown ({label}; SPICE: {'; '.join(spice_gaps)}).",
        f"Load the missing kernels with --kernels, or give a pose file (--pose) with {', '.join(unknown)}.{needed} "
        f"{IN_IMAGE_TOO}",
    )
