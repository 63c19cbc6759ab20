"""The parts of a pose that loaded SPICE kernels know, and words for the parts they do not."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera
from catalog.pose import PartialPose
from catalog.spice import Kernel, kernel_pool, spice_message
from catalog.target import Target
from catalog.times import utc_from_et

LIGHT_KM_PER_S = 299792.458
SUN = 10
ABERRATION = "LT+S"


@dataclass(frozen=True)
class SpicePose:
    """parts: what the kernels cover. missing: one text for each other part, naming kernel type and body. kernels: what
    was furnished."""

    parts: PartialPose
    missing: tuple[str, ...]
    kernels: tuple[Kernel, ...]


def pose_parts_from_spice(
    camera: Camera,
    target: Target,
    et: float,
    kernels: Iterable[Path],
    light_time_s: float | None = None,
) -> SpicePose:
    """Whatever parts of the pose at `et` (TDB seconds past J2000) the kernels cover.

    Target from spacecraft: LT+S, and with it the velocities. Body attitude and Sun: at the time the light left the
    target, as SPICE's ILUMIN does; `light_time_s` stands in when the trajectory is not covered. Camera: the C-kernel's
    attitude, mapped to the camera frame. Nothing raises for lack of coverage; RefusedError for a kernel that cannot be
    loaded.
    """
    with kernel_pool(kernels) as loaded:
        return pose_parts_from_loaded(camera, target, et, loaded, light_time_s)


def pose_parts_from_loaded(
    camera: Camera, target: Target, et: float, loaded: list[Kernel], light_time_s: float | None = None
) -> SpicePose:
    """The same with kernels that a `kernel_pool` around the call holds: for many images at once."""
    if not loaded:
        return SpicePose(PartialPose(et=et), ("no kernels are loaded",), ())
    missing: list[str] = []
    position, own_light_time_s = _target_from_spacecraft(camera, target, et, loaded, missing)
    light_time_s = own_light_time_s if own_light_time_s is not None else light_time_s
    emission_et = None if light_time_s is None else et - light_time_s
    parts = PartialPose(
        et=et,
        camera_from_j2000=orientation_from_loaded(camera, et, missing),
        target_from_spacecraft_km=position,
        sun_from_target_km=None if emission_et is None else _sun_from_target(target, emission_et, loaded, missing),
        body_from_j2000=None if emission_et is None else _body_from_j2000(target, emission_et, missing),
        **_velocities(camera, target, et, None if position is None else emission_et),
    )
    return SpicePose(parts, tuple(missing), tuple(loaded))


def _target_from_spacecraft(
    camera: Camera, target: Target, et: float, loaded: list[Kernel], missing: list[str]
) -> tuple[NDArray[np.float64] | None, float | None]:
    import spiceypy
    from spiceypy.utils.exceptions import SpiceyError

    if camera.naif_spacecraft_id is None:
        missing.append(f"SPK: camera {camera.name} names no naif_spacecraft_id")
        return None, None
    try:
        position, light_time_s = spiceypy.spkpos(
            str(target.naif_id), et, "J2000", ABERRATION, str(camera.naif_spacecraft_id)
        )
    except SpiceyError as error:
        bodies = [camera.naif_spacecraft_id, target.naif_id, *_barycentre(target.naif_id)]
        missing.append(f"SPK: position of {target.name}, {_gap(bodies, et, loaded, error)}")
        return None, None
    return np.asarray(position), float(light_time_s)


def _velocities(camera: Camera, target: Target, et: float, emission_et: float | None) -> dict[str, Any]:
    """Of spacecraft and target relative to the solar system's barycentre; nothing where no trajectory is known."""
    import spiceypy

    if emission_et is None:
        return {}
    spacecraft, body = (
        np.asarray(spiceypy.spkssb(naif_id, when, "J2000"))[3:]
        for naif_id, when in ((camera.naif_spacecraft_id, et), (target.naif_id, emission_et))
    )
    return {"spacecraft_velocity_km_s": spacecraft, "target_velocity_km_s": body}


def _sun_from_target(
    target: Target, emission_et: float, loaded: list[Kernel], missing: list[str]
) -> NDArray[np.float64] | None:
    import spiceypy
    from spiceypy.utils.exceptions import SpiceyError

    try:
        return np.asarray(spiceypy.spkpos(str(SUN), emission_et, "J2000", ABERRATION, str(target.naif_id))[0])
    except SpiceyError as error:
        bodies = [target.naif_id, *_barycentre(target.naif_id), SUN]
        missing.append(f"SPK: the Sun from {target.name}, {_gap(bodies, emission_et, loaded, error)}")
        return None


def _body_from_j2000(target: Target, emission_et: float, missing: list[str]) -> NDArray[np.float64] | None:
    import spiceypy
    from spiceypy.utils.exceptions import SpiceyError

    if not target.body_frame:
        missing.append(f"PCK: target {target.name} names no body frame")
        return None
    try:
        return np.asarray(spiceypy.pxform("J2000", target.body_frame, emission_et))
    except SpiceyError as error:
        missing.append(f"PCK: rotation of {target.name} ({target.body_frame}): {spice_message(error)}")
        return None


def orientation_from_loaded(camera: Camera, et: float, missing: list[str]) -> NDArray[np.float64] | None:
    """The camera's orientation (3, 3) by the C-kernels that a `kernel_pool` around the call holds; None, and why in
    `missing`, where they have none. camera_from_instrument @ instrument_from_platform (FK) @ platform_from_j2000."""
    import spiceypy
    from spiceypy.utils.exceptions import NotFoundError, SpiceyError

    if camera.naif_ck_id is None or camera.naif_spacecraft_id is None:
        missing.append(f"CK: camera {camera.name} names no naif_ck_id")
        return None
    platform = f"{camera.naif_ck_frame or 'frame'} ({camera.naif_ck_id})"
    try:
        ticks = spiceypy.sce2c(camera.naif_spacecraft_id, et)
        tolerance = spiceypy.sce2c(camera.naif_spacecraft_id, et + camera.ck_tolerance_s) - ticks
    except SpiceyError as error:
        missing.append(f"SCLK: clock of spacecraft {camera.naif_spacecraft_id}: {spice_message(error)}")
        return None
    try:
        platform_from_j2000, _ = spiceypy.ckgp(camera.naif_ck_id, ticks, tolerance, "J2000")
    except (NotFoundError, SpiceyError):
        missing.append(f"CK: orientation of {platform} at {utc_from_et(et)}, within {camera.ck_tolerance_s:g} s")
        return None
    try:
        of_instrument = instrument_from_platform(camera, et)
    except SpiceyError as error:
        missing.append(f"FK: {camera.instrument_frame} relative to {platform}: {spice_message(error)}")
        return None
    return np.asarray(camera.camera_from_instrument, float) @ of_instrument @ platform_from_j2000


def instrument_from_platform(camera: Camera, et: float) -> NDArray[np.float64]:
    """Rotation (3, 3) from the mission's platform frame to the instrument frame, by the loaded FK; SpiceyError when it
    does not know them. The identity for a camera that hangs on the platform itself."""
    import spiceypy

    if camera.instrument_frame is None:
        return np.eye(3)
    return np.asarray(spiceypy.pxform(spiceypy.frmnam(camera.naif_ck_id), camera.instrument_frame, et))


def _barycentre(naif_id: int) -> list[int]:
    return [naif_id // 100] if 100 <= naif_id < 1000 else []


def _gap(bodies: list[int], et: float, loaded: list[Kernel], error: Exception) -> str:
    """Which bodies no loaded SPK covers at `et`; SPICE's own words when all are covered but not connected."""
    uncovered = [body for body in bodies if not _covered(body, et, loaded)]
    if not uncovered:
        return spice_message(error)
    return f"no loaded SPK covers NAIF bodies {', '.join(map(str, uncovered))} at {utc_from_et(et)}"


def _covered(body: int, et: float, loaded: list[Kernel]) -> bool:
    import spiceypy

    for kernel in loaded:
        if kernel.kind != "spk" or body not in spiceypy.spkobj(kernel.for_spice):
            continue
        if spiceypy.wnelmd(et, spiceypy.spkcov(kernel.for_spice, body)):
            return True
    return False
