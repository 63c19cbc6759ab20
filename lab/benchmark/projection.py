"""How fast the projection is, and how well it agrees with SPICE, on this machine."""

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera
from catalog.pose import Pose
from catalog.rotation import rotation_from_vector_deg
from catalog.spice import kernel_pool
from catalog.target import Target
from lab.benchmark.spice_oracle import project_with_spice, write_kernels
from tasks.project.backplanes import ANGLES, PLANES, Backplanes, Window, full_window
from tasks.project.curves import limb_points
from tasks.project.pixels import project_pixels
from tasks.project.planes import project_planes

EUROPA = Target(name="europa", naif_id=502, radii_km=(1562.6, 1560.3, 1559.5))
REPEATS = 20
SPICE_PIXELS = 2000
LIMB_PIXELS = 400
OFF_LIMB_DEG = 80.0


def benchmark_projection(size: int = 1024, peers: bool = False) -> dict[str, Any]:
    """Five planes (latitude, longitude, incidence, emission, phase) of a size x size frame that the disk fills.

    Returns, in seconds: ours_s and numpy_s (best of several runs), first_call_s (loading or building the compiled
    code included), spice_loop_s (SINCPT + ILUMIN + RECLAT per pixel, scaled up from spice_pixels_timed random pixels of
    the frame). max_difference_deg: the largest angle between ours and SPICE's over those pixels and the limb's
    (longitude differences times cos latitude); limb_difference_deg: at the limb pixels alone. Needs no kernels.
    peers: rms-oops and PlanetMapper on the same frame too, each with seconds and how much slower than ours it is, its
    largest difference and the largest at emission below 80 deg; null where it is not installed.
    """
    pose, camera = frame_filling_scene(size)
    first_call_s, _ = _timed(lambda: project_planes(pose, camera, EUROPA, planes=ANGLES))
    ours_s, ours = _best(lambda: project_planes(pose, camera, EUROPA, planes=ANGLES))
    numpy_s, plain = _best(lambda: project_planes_with_numpy(pose, camera, EUROPA, planes=ANGLES), repeats=3)
    random_xy = np.random.default_rng(0).integers(0, size, (SPICE_PIXELS, 2))
    limb_xy = _pixels_inside_limb(ours, limb_points(pose, camera, EUROPA, LIMB_PIXELS))
    with TemporaryDirectory() as folder, kernel_pool([]):
        write_kernels(pose, EUROPA, Path(folder))
        with kernel_pool([Path(folder)]):
            timed_s, at_random = _timed(lambda: project_with_spice(pose, camera, random_xy))
            at_limb = project_with_spice(pose, camera, limb_xy)
    spice_loop_s = timed_s * size * size / SPICE_PIXELS
    limb_difference = _difference_deg(ours, limb_xy, at_limb)
    figures = {
        "size_px": [size, size],
        "planes": list(ANGLES),
        "on_body_fraction": float(ours.on_body.mean()),
        "ours_s": ours_s,
        "numpy_s": numpy_s,
        "spice_loop_s": spice_loop_s,
        "spice_pixels_timed": SPICE_PIXELS,
        "spice_pixels_at_limb": len(limb_xy),
        "times_faster_than_numpy": numpy_s / ours_s,
        "times_faster_than_spice": spice_loop_s / ours_s,
        "max_difference_deg": max(_difference_deg(ours, random_xy, at_random), limb_difference),
        "limb_difference_deg": limb_difference,
        "numpy_difference_deg": _planes_difference_deg(ours, plain),
        "first_call_s": first_call_s,
    }
    return figures | ({"peers": peer_figures(pose, camera, ours, ours_s)} if peers else {})


def peer_figures(pose: Pose, camera: Camera, ours: Backplanes, ours_s: float) -> dict[str, Any]:
    """What other programs make of the same frame; None for one that is not installed."""
    from lab.benchmark.peers import PEERS

    figures: dict[str, Any] = {}
    for name, planes_by_peer in PEERS.items():
        try:
            seconds, planes = planes_by_peer(pose, camera, EUROPA)
        except ModuleNotFoundError:
            figures[name] = None
            continue
        peer = Backplanes(ours.window, planes)
        off_limb = Backplanes(
            ours.window, {n: np.where(ours.emission < OFF_LIMB_DEG, planes[n], np.nan) for n in ANGLES}
        )
        figures[name] = {
            "seconds": seconds,
            "times_slower": seconds / ours_s,
            "max_difference_deg": _planes_difference_deg(ours, peer),
            "off_limb_difference_deg": _planes_difference_deg(ours, off_limb),
            "pixels_seen_by_one_only": int((ours.on_body != np.isfinite(planes["latitude"])).sum()),
        }
    return figures


def frame_filling_scene(size: int) -> tuple[Pose, Camera]:
    """A disk as wide as the frame, half lit, turned every way, at the range where that is so."""
    camera = Camera(
        name="benchmark", size_px=(size, size), centre_px=((size - 1) / 2, (size - 1) / 2), focal_length_px=2e5
    )
    camera_from_j2000 = rotation_from_vector_deg([17.0, 57.0, -110.0])
    range_km = EUROPA.mean_radius_km * camera.focal_length_px / (size / 2)
    to_target = camera_from_j2000.T @ np.array([0.0, 0.0, range_km])
    sun = camera_from_j2000.T @ (7.8e8 * np.array([0.6, -0.3, -np.sqrt(0.55)]))
    return Pose(0.0, camera_from_j2000, to_target, sun, rotation_from_vector_deg([60.0, 10.0, 30.0])), camera


def _timed(work: Callable[[], Any]) -> tuple[float, Any]:
    started = time.perf_counter()
    result = work()
    return time.perf_counter() - started, result


def _best(work: Callable[[], Backplanes], repeats: int = REPEATS) -> tuple[float, Backplanes]:
    runs = [_timed(work) for _ in range(repeats)]
    return min(seconds for seconds, _ in runs), runs[-1][1]


def _pixels_inside_limb(planes: Backplanes, limb_xy: NDArray[np.float64]) -> NDArray[np.int64]:
    """Outermost pixels on the body: of the whole pixels around each limb point, those that see it."""
    corners = np.floor(limb_xy)[:, None, :] + np.array([[0, 0], [1, 0], [0, 1], [1, 1]])
    xy = np.unique(corners.reshape(-1, 2).astype(np.int64), axis=0)
    ny, nx = planes.on_body.shape
    xy = xy[(xy >= 0).all(axis=1) & (xy[:, 0] < nx) & (xy[:, 1] < ny)]
    return xy[planes.on_body[xy[:, 1], xy[:, 0]]]


def _difference_deg(ours: Backplanes, xy: NDArray[np.int64], spice: NDArray[np.float64]) -> float:
    x, y = xy.T
    mine = np.stack([ours[name][y, x] for name in ANGLES], axis=1)
    if not np.array_equal(np.isnan(mine), np.isnan(spice)):
        return float("inf")
    return _largest(mine, spice)


def _planes_difference_deg(a: Backplanes, b: Backplanes) -> float:
    return _largest(*(np.stack([p[name].ravel() for name in ANGLES], axis=1) for p in (a, b)))


def _largest(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    """Largest difference of rows in the order of ANGLES, longitudes along the parallel."""
    off = a - b
    off[:, 1] = ((off[:, 1] + 180) % 360 - 180) * np.cos(np.radians(a[:, 0]))
    return float(np.nanmax(np.abs(off)))


def project_planes_with_numpy(
    pose: Pose, camera: Camera, target: Target, window: Window | None = None, planes: Sequence[str] = PLANES
) -> Backplanes:
    """As `project_planes`, whole arrays at a time: the intersection for all pixels, the angles where they hit."""
    x0, y0, x1, y1 = window = window or full_window(camera)
    xy = np.stack(np.meshgrid(np.arange(x0, x1), np.arange(y0, y1)), axis=-1).astype(np.float64)
    return Backplanes(window, project_pixels(pose, camera, target, xy, planes))
