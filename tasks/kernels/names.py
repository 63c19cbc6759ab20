"""Names and NAIF numbers of what the kernels define: a frame per camera, a clock, a craft for cameras without one.

Numbers follow from names, so that sets written on different days and machines agree: frames take 1 500 000 to
1 899 999, which NAIF leaves to everybody (frames.req); structures, instruments and craft are negative.
"""

import hashlib
import re
from typing import Any

from catalog.camera import Camera
from catalog.target import Target

PREFIX = "POSE"
CLOCK_ID = -1_999_001
CLOCK_NAME = f"{PREFIX}_CLOCK"
FIRST_ID, IDS = 1_500_000, 400_000
LONGEST_NAME = 26  # of a frame: its variable FRAME_<name> may have 32 characters


def _spelled(name: str) -> str:
    whole = f"{PREFIX}_{re.sub(r'[^A-Z0-9]+', '_', name.upper())}"
    if len(whole) <= LONGEST_NAME:
        return whole
    return f"{whole[: LONGEST_NAME - 7]}_{hashlib.sha256(name.encode()).hexdigest()[:6].upper()}"


def _number(kind: str, name: str) -> int:
    return FIRST_ID + int(hashlib.sha256(f"{kind} {name}".encode()).hexdigest()[:12], 16) % IDS


def camera_frame(camera: Camera) -> str:
    """Name of the camera's frame: +X sample, +Y line, +Z boresight, as in a pose."""
    return _spelled(camera.name)


def camera_frame_id(camera: Camera) -> int:
    """Number of the camera's frame; its structure and instrument are the negative of it."""
    return _number("camera", camera.name)


def craft_id(camera: Camera) -> int:
    """NAIF number of the spacecraft; an own one for a camera that names none."""
    return camera.naif_spacecraft_id if camera.naif_spacecraft_id is not None else -_number("craft", camera.name)


def craft_name(camera: Camera) -> str | None:
    """Name that the kernels give to an own craft; None when the mission has one."""
    return _spelled(f"{camera.name} craft") if camera.naif_spacecraft_id is None else None


def target_frame(target: Target) -> str:
    """Body-fixed frame whose attitude the kernels give: NAIF's own where SPICE has it without kernels (IAU_EUROPA)."""
    return target.body_frame if is_built_in(target) else _spelled(target.name)


def target_frame_id(target: Target) -> int:
    """Number of an own body-fixed frame."""
    return _number("target", target.name)


def is_built_in(target: Target) -> bool:
    """Whether SPICE knows the target's IAU frame by itself, as a PCK frame of the target's own number."""
    import spiceypy

    found: Any = spiceypy.namfrm(target.body_frame) if target.body_frame else 0
    if not found or found >= FIRST_ID:
        return False
    centre, frame_class, class_id = spiceypy.frinfo(found)[:3]
    return bool(frame_class == 2 and class_id == centre == target.naif_id)
