"""What `planetpose improve-map` makes of the orientations of a simulated archive's images."""

import time
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from catalog.basemap import map_of_target
from catalog.pose import Pose, read_pose_file
from catalog.rotation import vector_deg_from_rotation
from tasks.improve.files import sigma_across_deg
from tasks.improve.improve import Improved, improve_map
from tasks.improve.settings import ImproveSettings

Array = NDArray[np.float64]
ROUNDS = 20
LEAST_DEG = 0.02  # errors below count alike in the turn that all images have in common


def errors_across_deg(poses: Sequence[Pose], truth: Sequence[Pose]) -> tuple[Array, Array]:
    """Errors (n,) of the body's orientation in the camera's frame across the line of sight, degrees, less a turn (3,)
    that all have in common, and that turn: the true map may lie otherwise in the body's frame than the old one. It is
    the turn that makes the sum of the errors least (weights by iteration)."""
    off = np.array(
        [
            vector_deg_from_rotation(pose.camera_from_body.T @ true.camera_from_body)
            for pose, true in zip(poses, truth, strict=True)
        ]
    )
    sight = np.array([true.spacecraft_in_body_km / true.range_km for true in truth])
    across = np.eye(3) - sight[:, :, None] * sight[:, None, :]
    turn: Array = np.zeros(3)
    for _ in range(ROUNDS):
        size = np.linalg.norm(np.einsum("nij,nj->ni", across, off - turn), axis=1)
        weight = 1 / np.maximum(size, LEAST_DEG)
        normal = np.einsum("n,nij->ij", weight, across)
        turn = np.linalg.solve(normal, np.einsum("n,nij,nj->i", weight, across, off))
    return np.linalg.norm(np.einsum("nij,nj->ni", across, off - turn), axis=1), turn


def compared(improved: Improved, archive: Path) -> dict[str, float]:
    """Errors of the published and of the improved orientations of a simulated archive's images (medians, 90 %), shares
    of errors inside 1 and 2 of their stated sigmas, and how far all are turned together."""
    members = improved.members
    truth = [read_pose_file(archive / f"{member.product}.truth.json").completed() for member in members]
    before, _ = errors_across_deg([member.before for member in members], truth)
    after, turn = errors_across_deg([member.pose for member in members], truth)
    moved = np.array([member.fit is not None for member in members])
    sigma = np.array([sigma_across_deg(member, member.covariance) for member in members])
    # Two directions: the length of an error has Rayleigh's distribution, 39 and 86 % within 1 and 2 sigma.
    return {
        "images": len(members),
        "improved": int(moved.sum()),
        "before_median_deg": float(np.median(before)),
        "before_90_deg": float(np.percentile(before, 90)),
        "after_median_deg": float(np.median(after)),
        "after_90_deg": float(np.percentile(after, 90)),
        "large_disks_before_deg": _of_large(before, improved, truth),
        "large_disks_after_deg": _of_large(after, improved, truth),
        "within_1": float(np.mean(after < sigma)),
        "within_2": float(np.mean(after < 2 * sigma)),
        "turned_together_deg": float(np.linalg.norm(turn)),
        "rounds": len(improved.moves),
    }


def _of_large(errors: Array, improved: Improved, truth: Sequence[Pose]) -> float:
    """Median over disks of at least 120 px."""
    from tasks.mosaic.view import load_view
    from tasks.simulate.window import disk_radius_px

    large = [
        disk_radius_px(true, load_view(member.folder).camera, improved.target) >= 60
        for member, true in zip(improved.members, truth, strict=True)
    ]
    return float(np.median(errors[np.array(large)])) if any(large) else float("nan")


def measured_improvement(archive: Path, store: Path, settings: ImproveSettings) -> Mapping[str, float]:
    """`compared` of a store of an archive's images, and the processor seconds of its improvement."""
    start = time.process_time()
    improved = improve_map(store, map_of_target, settings)
    seconds = time.process_time() - start
    return {**compared(improved, archive), "cpu_s": seconds}
