"""The same frame by other programs, for the benchmark: rms-oops and PlanetMapper (optional extra `lab`).

Each gets the pose's fixed geometry in its own terms, so that only the program differs: PlanetMapper through the
oracle's SPICE kernels, oops through straight paths. oops divides by an observer's speed, so its bodies creep along at
a micrometre a second.
"""

from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera
from catalog.pose import Pose
from catalog.spice import kernel_pool
from catalog.target import Target
from lab.benchmark.spice_oracle import BODY, BODY_ID, FRAME, SPACECRAFT, write_kernels

Array = NDArray[np.float64]
CREEP_KM_S = 1e-9
PLANETMAPPER_PLANES = {
    "latitude": "LAT-CENTRIC", "longitude": "LON-CENTRIC", "incidence": "INCIDENCE", "emission": "EMISSION",
    "phase": "PHASE",
}  # fmt: skip
PLANETMAPPER_NEEDS = f"""KPL/LSK
\\begindata
DELTET/DELTA_T_A = 32.184
DELTET/K = 1.657D-3
DELTET/EB = 1.671D-2
DELTET/M = ( 6.239996D0 1.99096871D-7 )
DELTET/DELTA_AT = ( 32, @1999-JAN-1 )
BODY{BODY_ID}_PM = ( 0.0 1.0 0.0 )
BODY{BODY_ID}_POLE_RA = ( 0.0 0.0 0.0 )
BODY{BODY_ID}_POLE_DEC = ( 90.0 0.0 0.0 )
\\begintext
"""


def planes_by_planetmapper(pose: Pose, camera: Camera, target: Target) -> tuple[float, dict[str, Array]]:
    """Seconds and the five ANGLES (ny, nx), degrees, by PlanetMapper; the pose's time must be J2000.

    Raises ModuleNotFoundError when it is not installed.
    """
    import planetmapper

    planetmapper.base.prevent_kernel_loading()
    nx, ny = camera.size_px
    with TemporaryDirectory() as folder, kernel_pool([]):
        Path(folder, "needs.tls").write_text(PLANETMAPPER_NEEDS)
        write_kernels(pose, target, Path(folder))
        with kernel_pool([Path(folder)]):
            body = planetmapper.BodyXY(
                BODY, "2000-01-01T12:00:00", SPACECRAFT, nx=nx, ny=ny, aberration_correction="NONE", target_frame=FRAME
            )
            _aim(body, pose, camera)
            started = perf_counter()
            found = {name: body.get_backplane_img(theirs) for name, theirs in PLANETMAPPER_PLANES.items()}
            seconds = perf_counter() - started
    return seconds, {name: np.asarray(plane)[::-1] for name, plane in found.items()}


def _aim(body: Any, pose: Pose, camera: Camera) -> None:
    """Tell PlanetMapper, whose y runs up, the disk's centre, scale and the roll that sets a second point right."""
    top = camera.size_px[1] - 1
    x, y = camera.project(pose.target_in_camera_km)
    aside = np.array([x + 0.3 * camera.size_px[0], y])
    body.set_plate_scale_arcsec(np.degrees(np.arctan(1 / camera.focal_length_px)) * 3600)
    body.set_x0(x)
    body.set_y0(top - y)
    body.set_rotation(0.0)
    east, north, up = camera.ray(aside) @ pose.camera_from_j2000
    radec = np.degrees(np.arctan2(north, east)) % 360, np.degrees(np.arcsin(up))
    off = np.array(body.radec2xy(*radec)) - [x, top - y]
    roll = float(np.degrees(np.arctan2(off[1], off[0])))
    wrong = {}
    for turn in (roll, -roll):
        body.set_rotation(turn % 360)
        wrong[turn] = np.hypot(*(np.array(body.radec2xy(*radec)) - [aside[0], top - aside[1]]))
    body.set_rotation(min(wrong, key=lambda turn: float(wrong[turn])) % 360)


def planes_by_oops(pose: Pose, camera: Camera, target: Target) -> tuple[float, dict[str, Array]]:
    """Seconds and the five ANGLES (ny, nx), degrees, by rms-oops' Backplane.

    Raises ModuleNotFoundError when it is not installed.
    """
    import oops
    from oops.body import Body
    from oops.fov import FlatFOV
    from oops.frame import Cmatrix
    from oops.observation.snapshot import Snapshot
    from oops.path import LinearPath
    from oops.surface import Ellipsoid

    fixed = f"{BODY}_FRAME"
    creep = np.eye(3) * CREEP_KM_S
    places = {SPACECRAFT: -pose.target_from_spacecraft_km, BODY: np.full(3, 1e-30), "SUN": pose.sun_from_target_km}
    for (name, place), velocity in zip(places.items(), creep, strict=True):
        LinearPath((place, velocity), 0.5, "SSB", frame="J2000", path_id=name)
    Cmatrix(pose.camera_from_j2000, "J2000", frame_id="PLANETPOSE_CAMERA")
    Cmatrix(pose.body_from_j2000, "J2000", frame_id=fixed)
    radii = target.radii_km
    Body(BODY, BODY, fixed).apply_surface(Ellipsoid(BODY, fixed, radii), max(radii), min(radii))
    Body("SUN", "SUN", "J2000")
    middle = tuple(np.asarray(camera.centre_px) + 0.5)  # oops counts pixels from their corners
    fov = FlatFOV(1 / camera.focal_length_px, camera.size_px, uv_los=middle)
    frame = Snapshot(("v", "u"), 0.0, 1.0, fov, SPACECRAFT, "PLANETPOSE_CAMERA")
    started = perf_counter()
    plane = oops.Backplane(frame)
    found = {
        "latitude": plane.latitude(BODY, lat_type="centric"),
        "longitude": plane.longitude(BODY, reference="iau", direction="east"),
        "incidence": plane.incidence_angle(BODY),
        "emission": plane.emission_angle(BODY),
        "phase": plane.phase_angle(BODY),
    }
    seconds = perf_counter() - started
    return seconds, {name: _degrees(values, camera.size_px) for name, values in found.items()}


def _degrees(values: Any, size_px: tuple[int, int]) -> Array:
    nx, ny = size_px
    masked = np.broadcast_to(values.mask, (ny, nx))
    return np.where(masked, np.nan, np.degrees(np.broadcast_to(values.vals, (ny, nx))))


PEERS = {"rms-oops": planes_by_oops, "planetmapper": planes_by_planetmapper}
