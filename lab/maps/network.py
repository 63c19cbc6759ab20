"""Control networks with known truth: what a bundle adjustment makes of planted errors of poses."""

import resource
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from catalog.camera import Camera
from catalog.pose import Pose
from catalog.rotation import rotation_from_vector_deg, vector_deg_from_rotation
from catalog.target import find_target
from lab.maps.albedo import blotches
from lab.simulate.albedo_store import paper_views, write_albedo_store
from tasks.control.bundle import adjust_bundle
from tasks.control.patches import places_on
from tasks.control.settings import ControlSettings
from tasks.control.store import control_report, control_store
from tasks.control.ties import Ties
from tasks.project.points import pixels_of_points, visible

Array = NDArray[np.float64]
CENTRE_SIGMA_PX, RANGE_SIGMA, ROLL_SIGMA_DEG = 0.02, 1e-5, 0.005
POINTS_PER_MEASURE = 1 / 6
# Images with fewer ties share too little ground to say anything of their orientation.
LEAST_TIES = 10


@dataclass(frozen=True)
class MadeNetwork:
    """true, wrong: poses of the images; cameras; ties; priors (images, 7, 7) of the wrong poses; false (measures,):
    ties that were moved on purpose."""

    true: list[Pose]
    wrong: list[Pose]
    cameras: list[Camera]
    ties: Ties
    priors: Array
    false: NDArray[np.bool_]


def made_network(
    images: int,
    per_image: int,
    rng: np.random.Generator,
    noise_px: float = 0.1,
    false: float = 0.0,
    turned_deg: float = 0.08,
) -> MadeNetwork:
    """Cameras around Europa, ties of exactly known points with noise (1-sigma, px). false: share of the ties that are
    1.5 to 6 px off; turned_deg: 1-sigma of the body's orientation about each axis."""
    europa = find_target("europa")
    camera = Camera(name="made", size_px=(400, 400), centre_px=(199.5, 199.5), focal_length_px=2e4)
    places = places_on(europa, max(int(images * per_image * POINTS_PER_MEASURE), 60)).points
    true, wrong, image, point, xy = [], [], [], [], []
    for number in range(images):
        longitude, latitude = rng.uniform(-180, 180), rng.uniform(-25, 25)
        body = Rotation.from_euler("ZYX", [90 + longitude, 0, 90 + latitude], degrees=True).as_matrix()
        pose = Pose(float(number), np.eye(3), np.array([0.0, 0.0, 2e5]), np.array([1e8, 0.0, -7e8]), body)
        shown = rng.permutation(np.flatnonzero(visible(pose, europa, places)))[:per_image]
        true.append(pose)
        wrong.append(pose.replaced(body_from_j2000=rotation_from_vector_deg(rng.normal(0, turned_deg, 3)) @ body))
        image += [number] * len(shown)
        point += shown.tolist()
        xy.append(pixels_of_points(pose, camera, places[shown]) + rng.normal(0, noise_px, (len(shown), 2)))
    xy_px = np.concatenate(xy)
    moved = rng.uniform(size=len(xy_px)) < false
    xy_px[moved] += rng.uniform(1.5, 6, (moved.sum(), 2)) * rng.choice([-1, 1], (moved.sum(), 2))
    n = len(xy_px)
    covariance = np.tile(noise_px**2 * np.eye(2), (n, 1, 1))
    ties = Ties(places, np.array(image), np.array(point), xy_px, covariance, np.ones(n), np.zeros(n, bool), np.ones(n))
    shared = (np.bincount(ties.point, minlength=len(places)) >= 2)[ties.point]
    prior = np.square([CENTRE_SIGMA_PX, CENTRE_SIGMA_PX, RANGE_SIGMA, ROLL_SIGMA_DEG, *[turned_deg] * 3])
    priors = np.tile(np.diag(prior), (images, 1, 1))
    return MadeNetwork(true, wrong, [camera] * images, ties.part(np.ones(n, bool)), priors, moved[shared])


def across_deg(pose: Pose, true: Pose) -> float:
    """Error of the body's orientation across the line of sight, RMS of two axes, degrees."""
    turn = vector_deg_from_rotation((pose.body_from_j2000 @ true.body_from_j2000.T).T)
    sight = true.spacecraft_in_body_km / true.range_km
    return float(np.linalg.norm(turn - sight * (turn @ sight)) / np.sqrt(2))


def rms_across_deg(poses: Sequence[Pose], true: Sequence[Pose]) -> float:
    """Root of the mean square of `across_deg`."""
    errors = [across_deg(pose, each) for pose, each in zip(poses, true, strict=True)]
    return float(np.sqrt(np.mean(np.square(errors))))


def measured_network(images: int, per_image: int, seed: int = 1) -> dict[str, float]:
    """Errors across the sight before and after (deg, RMS), shares of false ties that are rejected and of true ones that
    are kept, processor seconds and peak memory (MB) of the adjustment of a made network."""
    network = made_network(images, per_image, np.random.default_rng(seed), false=0.03)
    before = time.process_time()
    bundle = adjust_bundle(
        network.wrong, network.cameras, find_target("europa"), network.ties, network.priors, ControlSettings()
    )
    seconds = time.process_time() - before
    lonely = np.bincount(network.ties.point[~network.false], minlength=len(network.ties.points))[network.ties.point] < 2
    return {
        "images": images,
        "measures": len(network.ties.point),
        "across_before_deg": rms_across_deg(network.wrong, network.true),
        "across_after_deg": rms_across_deg(bundle.poses, network.true),
        "false_rejected": float(np.mean(~bundle.used[network.false])),
        "true_kept": float(np.mean(bundle.used[~network.false & ~lonely])),
        "cpu_s": seconds,
        "peak_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    }


def measured_views(views: int, attitude_error_deg: float = 0.08, centre_sigma_px: float = 0.05) -> dict[str, float]:
    """The same of the paper's views, rendered with a planted albedo, their orientations wrong by `attitude_error_deg`
    about each axis and their centres known to `centre_sigma_px`; of those that share ground."""
    chosen = paper_views()[:: max(57 // views, 1)][:views]
    stated = {
        "offset_px": [centre_sigma_px] * 2,
        "range_factor": 1e-4,
        "roll_deg": 0.01,
        "attitude_deg": [attitude_error_deg] * 3,
    }
    with tempfile.TemporaryDirectory() as folder:
        write_albedo_store(
            Path(folder),
            chosen,
            blotches(7, (512, 1024), (3, 8)),
            noise=0.004,
            attitude_error_deg=attitude_error_deg,
            stated=stated,
        )
        before = time.process_time()
        found = control_store(Path(folder), ControlSettings())
        seconds = time.process_time() - before
    true = {view.product: view.pose for view in chosen}
    tied = np.bincount(found.ties.image, minlength=len(found.views)) >= LEAST_TIES
    which = [number for number in range(len(found.views)) if tied[number]]
    truth = [true[found.views[number].product] for number in which]
    report = control_report(found)
    return {
        "images": len(found.views),
        "sharing_ground": len(which),
        "measures": len(found.ties.image),
        "points": len(found.ties.points),
        "ties_rms_px": report["rms_px"],
        "across_before_deg": rms_across_deg([found.views[number].pose for number in which], truth),
        "across_after_deg": rms_across_deg([found.bundle.poses[number] for number in which], truth),
        "across_stated_deg": float(
            np.sqrt(np.mean([np.trace(found.bundle.covariance[number, 4:, 4:]) / 3 for number in which]))
        ),
        "cpu_s": seconds,
    }
