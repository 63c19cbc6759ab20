"""Other bodies of an image, out of loaded SPICE kernels: where the spacecraft sees them, and they see each other."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from catalog.body import Target
from catalog.camera import Camera
from catalog.placed_body import PlacedBody
from catalog.spice_pose import ABERRATION, SUN

Vector = NDArray[np.float64]


def bodies_from_loaded(camera: Camera, target: Target, et: float, candidates: Iterable[Target]) -> list[PlacedBody]:
    """Those of the candidates that the kernels loaded around the call cover at `et` (TDB seconds past J2000), placed
    relative to the target by LT+S; none where the kernels do not cover the target or the spacecraft."""
    seen = None if camera.naif_spacecraft_id is None else _seen(target.naif_id, camera.naif_spacecraft_id, et)
    if seen is None:
        return []
    placed = (_placed(camera, each, et, seen[0]) for each in candidates if each.naif_id != target.naif_id)
    return [body for body in placed if body is not None]


def _placed(camera: Camera, body: Target, et: float, target_km: Vector) -> PlacedBody | None:
    import spiceypy
    from spiceypy.utils.exceptions import SpiceyError

    seen = _seen(body.naif_id, int(camera.naif_spacecraft_id or 0), et)
    if seen is None:
        return None
    position, light_time_s = seen
    emission_et = et - light_time_s
    try:
        sun = spiceypy.spkpos(str(SUN), emission_et, "J2000", ABERRATION, str(body.naif_id))[0]
        velocity = np.asarray(spiceypy.spkssb(body.naif_id, emission_et, "J2000"))[3:]
    except SpiceyError:
        return None
    return PlacedBody.of(
        body,
        from_target_km=tuple(position - target_km),
        sun_from_body_km=tuple(sun),
        body_from_j2000=_orientation(body, emission_et),
        velocity_km_s=tuple(velocity),
    )


def _seen(naif_id: int, observer: int, et: float) -> tuple[Vector, float] | None:
    """Position (3,) and light time, s, by LT+S; None where no kernel covers it."""
    import spiceypy
    from spiceypy.utils.exceptions import SpiceyError

    try:
        position, light_time_s = spiceypy.spkpos(str(naif_id), et, "J2000", ABERRATION, str(observer))
    except SpiceyError:
        return None
    return np.asarray(position), float(light_time_s)


def _orientation(body: Target, emission_et: float) -> Vector:
    """body_from_j2000 (3, 3) by the loaded PCK, else by the catalog's rotation model, else the axes of J2000."""
    import spiceypy
    from spiceypy.utils.exceptions import SpiceyError

    try:
        if body.body_frame:
            return np.asarray(spiceypy.pxform("J2000", body.body_frame, emission_et))
    except SpiceyError:
        pass
    return np.eye(3) if body.rotation is None else body.rotation.body_from_j2000(emission_et)


def seeing_each_other(camera: Camera, target: Target, et: float, bodies: list[PlacedBody]) -> tuple[PlacedBody, ...]:
    """The bodies with where the target and each of the others see them when their light left (LT+S, as the Sun)."""
    observers = [target.naif_id, *(body.naif_id for body in bodies)]
    emission = {}
    for observer in observers:
        seen = _seen(observer, int(camera.naif_spacecraft_id or 0), et)
        if seen is not None:
            emission[observer] = et - seen[1]
    whole = []
    for body in bodies:
        views = {each: _seen(body.naif_id, each, when) for each, when in emission.items() if each != body.naif_id}
        from_there = {each: tuple(map(float, view[0])) for each, view in views.items() if view is not None}
        whole.append(body.model_copy(update={"seen_from_km": from_there}))
    return tuple(whole)
