"""Where the camera is and where it is said to look: what SPICE kernels know without a target."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera
from catalog.spice import kernel_pool, spice_message
from catalog.spice_pose import ABERRATION, orientation_from_loaded
from catalog.stars.table import StarTable, aberrated, julian_year

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Observer:
    """et: mid-exposure, TDB seconds past J2000. velocity_km_s, position_km: (3,) J2000, relative to the solar system's
    barycentre. None for what is not known: then there is no proper motion, aberration or parallax."""

    et: float | None = None
    velocity_km_s: Array | None = None
    position_km: Array | None = None

    def apparent(self, stars: StarTable) -> Array:
        """Directions (n, 3) that stars are seen in: proper motion to the epoch, parallax, stellar aberration."""
        directions = stars.directions(stars.epoch if self.et is None else julian_year(self.et), self.position_km)
        return directions if self.velocity_km_s is None else aberrated(directions, self.velocity_km_s)


@dataclass(frozen=True)
class Surroundings:
    """What kernels say at a time. camera_from_j2000: by a C-kernel. target: (3,) unit vector of the apparent direction
    of a body. missing: what they do not know, in words."""

    observer: Observer
    camera_from_j2000: Array | None = None
    target: Array | None = None
    missing: tuple[str, ...] = ()


def surroundings(
    camera: Camera, et: float | None, kernels: Iterable[Path], target_id: int | None = None
) -> Surroundings:
    """What kernels (files, folders) say of a camera's place, motion and orientation at `et`, and of the direction of a
    body (NAIF id). Lack of coverage raises nothing; RefusedError for a kernel that cannot be loaded."""
    if et is None:
        return Surroundings(Observer(), missing=("the time of the exposure is not known",))
    import spiceypy
    from spiceypy.utils.exceptions import SpiceyError

    missing: list[str] = []
    position = velocity = target = None
    with kernel_pool(kernels) as loaded:
        if not loaded:
            return Surroundings(Observer(et), missing=("no kernels are loaded",))
        turned = orientation_from_loaded(camera, et, missing)
        if camera.naif_spacecraft_id is None:
            missing.append(f"SPK: camera {camera.name} names no naif_spacecraft_id")
            return Surroundings(Observer(et), turned, None, tuple(missing))
        try:
            state = np.asarray(spiceypy.spkssb(camera.naif_spacecraft_id, et, "J2000"))
            position, velocity = state[:3], state[3:]
        except SpiceyError as error:
            missing.append(f"SPK: spacecraft {camera.naif_spacecraft_id}: {spice_message(error)}")
        if target_id is not None:
            try:
                seen, _ = spiceypy.spkpos(str(target_id), et, "J2000", ABERRATION, str(camera.naif_spacecraft_id))
                target = np.asarray(seen) / np.linalg.norm(seen)
            except SpiceyError as error:
                missing.append(f"SPK: direction of body {target_id}: {spice_message(error)}")
    return Surroundings(Observer(et, velocity, position), turned, target, tuple(missing))
