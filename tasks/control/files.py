"""The files of a control: network, poses, tables, kernels."""

import csv
import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from catalog.camera import Camera
from catalog.camera_constants import FOCAL_LENGTH
from catalog.pose import write_pose_file
from catalog.spice import kernel_pool
from catalog.times import now_utc
from tasks.atomic import file_put_in_place
from tasks.control.camera_constants import constant_rows
from tasks.control.isis_net import Measure, Point, write_isis_net
from tasks.control.store import Control, control_report
from tasks.kernels.exposure import read_exposure
from tasks.kernels.sets import groups_of
from tasks.kernels.write import write_kernel_set
from tasks.project.points import latitude_longitude

NET, REPORT, IMAGES, POINTS = "control.net", "control.json", "images.csv", "points.csv"
COVARIANCES = "covariances.npz"


def write_control(control: Control, out: Path) -> list[Path]:
    """Write into `out`: the ISIS network, the report, tables of images and points, the covariances, camera files where
    focal lengths were solved, and a pose file per image, `PRODUCT.pose.json`, from which `planetpose correct --resume`
    goes on. Returns the paths but the poses'."""
    out.mkdir(parents=True, exist_ok=True)
    report = control_report(control)
    for view, pose in zip(control.views, control.bundle.poses, strict=True):
        with file_put_in_place(out / f"{view.product}.pose.json") as temporary:
            write_pose_file(pose, temporary)
    with file_put_in_place(out / REPORT) as temporary:
        temporary.write_text(json.dumps(report, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    _write_table(out / IMAGES, report["rows"])
    _write_table(out / POINTS, point_rows(control))
    with file_put_in_place(out / COVARIANCES) as temporary, temporary.open("wb") as file:
        products = np.array([view.product for view in control.views])
        np.savez(file, products=products, covariance=control.bundle.covariance, moves=control.bundle.moves)
    for path, camera in solved_cameras(control).items():
        with file_put_in_place(out / path) as temporary:
            temporary.write_text(camera.to_toml(), encoding="utf-8")
    target = control.views[0].target.name.capitalize()
    write_isis_net(out / NET, "planetpose", target, now_utc()[:19], "planetpose", network_points(control))
    return [out / name for name in (NET, REPORT, IMAGES, POINTS, COVARIANCES, *solved_cameras(control))]


def solved_cameras(control: Control) -> dict[str, Camera]:
    """By file name, the cameras with the focal length that was solved, with which the adjusted poses belong together;
    none where no focal length was solved."""
    if FOCAL_LENGTH not in control.settings.solve:
        return {}
    names = [camera.name for camera in control.bundle.constants.cameras]
    rows = constant_rows(control.bundle.constants, control.bundle.constants_covariance)
    found = {}
    for number, (camera, row) in enumerate(zip(control.bundle.constants.cameras, rows, strict=True)):
        factor = row["focal_length_factor"]
        changes = {
            "focal_length_px": camera.focal_length_px * factor["value"],
            "focal_length_mm": camera.focal_length_mm and camera.focal_length_mm * factor["value"],
            "focal_length_sigma": factor["sigma"],
        }
        own = names.count(camera.name) == 1
        found[f"{camera.name}.toml" if own else f"{camera.name}-{number + 1}.toml"] = camera.model_copy(update=changes)
    return found


def write_control_kernels(control: Control, folder: Path) -> list[Path]:
    """Write SPICE kernels of the adjusted poses, a set per mission, for use without the mission's own; returns the
    meta-kernels."""
    exposures = [
        replace(read_exposure(product), pose=pose)
        for product, pose in zip(control.folders, control.bundle.poses, strict=True)
    ]
    with kernel_pool(()) as loaded:
        sets = [
            write_kernel_set(name, members, folder, loaded)
            for name, members in sorted(groups_of(exposures, per_image=False).items())
        ]
    return [path for each in sets for path in each.meta_kernels.values()]


def point_rows(control: Control) -> list[dict[str, Any]]:
    """One row per point: place, 1-sigma, measures, residuals."""
    bundle, ties = control.bundle, control.ties
    latitude, longitude = latitude_longitude(bundle.points)
    length = np.hypot(*bundle.residual_px.T)
    rows = []
    for number in range(len(ties.points)):
        mine = ties.point == number
        used = mine & bundle.used
        rows.append(
            {
                "point": f"pp{number:06d}",
                "latitude_deg": round(float(latitude[number]), 6),
                "longitude_deg": round(float(longitude[number]), 6),
                "radius_km": round(float(np.linalg.norm(bundle.points[number])), 5),
                "sigma_east_km": round(float(bundle.point_sigma_km[number, 0]), 5),
                "sigma_north_km": round(float(bundle.point_sigma_km[number, 1]), 5),
                "measures": int(mine.sum()),
                "used": int(used.sum()),
                "rms_px": round(float(np.sqrt(np.mean(length[used] ** 2))), 4) if used.any() else "",
                "largest_px": round(float(length[used].max()), 4) if used.any() else "",
            }
        )
    return rows


def network_points(control: Control) -> list[Point]:
    """The points of the ISIS network. Serial numbers are the products' names: ISIS' own need its camera model."""
    bundle, ties = control.bundle, control.ties
    sigma_px = np.sqrt(np.einsum("nii->ni", ties.covariance))
    up = bundle.points / np.linalg.norm(bundle.points, axis=1, keepdims=True)
    east = np.cross([0.0, 0.0, 1.0], up)
    east /= np.maximum(np.linalg.norm(east, axis=1, keepdims=True), 1e-12)
    ways = np.stack([east, np.cross(up, east), up], axis=1)
    found = []
    for number in range(len(ties.points)):
        mine = np.flatnonzero(ties.point == number)
        mine = mine[np.argsort(ties.image[mine])]
        sigma = np.zeros(3)
        sigma[: bundle.point_sigma_km.shape[1]] = 1e3 * bundle.point_sigma_km[number]
        covariance = ways[number].T @ np.diag(sigma**2) @ ways[number]
        measures = [
            Measure(
                serial_number=control.views[ties.image[k]].product,
                sample=float(ties.xy_px[k, 0]) + 1,
                line=float(ties.xy_px[k, 1]) + 1,
                sample_residual=float(bundle.residual_px[k, 0]),
                line_residual=float(bundle.residual_px[k, 1]),
                sample_sigma=float(sigma_px[k, 0]),
                line_sigma=float(sigma_px[k, 1]),
                ignored=False,
                rejected=not bundle.used[k],
            )
            for k in mine
        ]
        reference = int(np.flatnonzero(ties.reference[mine])[0])
        lost = not bundle.used[mine].any()
        found.append(
            Point(
                f"pp{number:06d}",
                (1e3 * ties.points[number]).tolist(),
                (1e3 * bundle.points[number]).tolist(),
                covariance[np.triu_indices(3)].tolist(),
                reference,
                lost,
                measures,
            )
        )
    return found


def _write_table(path: Path, rows: Sequence[dict[str, Any]]) -> None:
    with file_put_in_place(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        if rows:
            writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)
