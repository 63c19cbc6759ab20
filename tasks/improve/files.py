"""The files of an improved map: the base map as GeoTIFF, its layers, poses and tables."""

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.pose import write_pose_file
from catalog.rotation import vector_deg_from_rotation
from tasks.atomic import file_put_in_place
from tasks.export.map_grid import body_crs
from tasks.improve.improve import Improved, Member
from tasks.improve.sums import left_edge_deg
from tasks.project.uncertainty import ATTITUDE
from tasks.publish.cube import software_version

Array = NDArray[np.float64]
REPORT, IMAGES, LAYERS = "improve-map.json", "images.csv", "layers.tif"
LAYER_UNITS = {"reflectance": "image units", "sigma": "image units", "count": "1", "resolution_km": "km"}


def write_improved(improved: Improved, out: Path) -> list[Path]:
    """Write the base map `out`, and into the folder of its name without suffix: layers, report, table of images and a
    pose file per image, `PRODUCT.pose.json`, for `planetpose correct --pose FILE --map OUT`. Returns the paths but the
    poses'."""
    folder = out.with_suffix("")
    folder.mkdir(parents=True, exist_ok=True)
    _write_tiff(improved, out, {"albedo": improved.values}, float("nan"))
    with np.errstate(invalid="ignore", divide="ignore"):
        sums = improved.sums
        resolution = np.where(sums.shown, sums.coarseness / sums.weight, np.nan)
    layers: dict[str, NDArray] = {
        "reflectance": sums.reflectance, "sigma": sums.sigma, "count": sums.count, "resolution_km": resolution,
    }  # fmt: skip
    _write_tiff(improved, folder / LAYERS, layers, float("nan"))
    for member in improved.members:
        with file_put_in_place(folder / f"{member.product}.pose.json") as temporary:
            write_pose_file(member.pose, temporary)
    report = improved_report(improved)
    with file_put_in_place(folder / REPORT) as temporary:
        temporary.write_text(json.dumps(report, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    with file_put_in_place(folder / IMAGES) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(report["rows"][0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(report["rows"])
    return [out, *(folder / name for name in (LAYERS, REPORT, IMAGES))]


def _write_tiff(improved: Improved, path: Path, layers: dict[str, NDArray], nodata: float) -> None:
    """Float32 bands of the whole map in degrees, pixels as areas, in strips: as every reader of TIFF takes it."""
    import rasterio
    from affine import Affine

    rows, columns = improved.grid.shape
    left, step = left_edge_deg(improved.grid), 180 / rows
    profile: dict[str, Any] = {
        "driver": "GTiff", "count": len(layers), "dtype": "float32", "height": rows, "width": columns,
        "crs": rasterio.crs.CRS.from_wkt(body_crs(improved.target).to_wkt("WKT2_2019")),
        "transform": Affine(step, 0.0, left, 0.0, -step, 90.0), "nodata": nodata, "compress": "deflate",
        "BIGTIFF": "IF_SAFER",
    }  # fmt: skip
    about = {
        "AREA_OR_POINT": "Area",
        "TARGET": improved.target.name,
        "LATITUDE_TYPE": "planetocentric",
        "POSITIVE_LONGITUDE_DIRECTION": "east",
        "LONGITUDE_RANGE": f"{left:g} to {left + 360:g}",
        "OLD_MAP": f"{improved.old_map.name} (sha256 {improved.old_map.sha256})",
        "FRAME_HELD_BY": improved.settings.hold_frame,
        "SOFTWARE": f"planetpose {software_version()}",
    }
    with file_put_in_place(path) as temporary, rasterio.open(temporary, "w", **profile) as file:
        for number, (name, values) in enumerate(layers.items(), start=1):
            file.write(np.asarray(values, np.float32), number)
            file.set_band_description(number, name)
            file.set_band_unit(number, LAYER_UNITS.get(name, ""))
        file.update_tags(**about)


def improved_report(improved: Improved) -> dict[str, Any]:
    """Plain values: how the iteration went, how the map lies against the old one, a row per image, what is missing."""
    return {
        "images": len(improved.members),
        "rounds": len(improved.moves),
        "moves_in_sigmas": list(improved.moves),
        "settled": improved.settled,
        "shown": float(np.mean(improved.sums.shown)),
        "frame_held_by": improved.settings.hold_frame,
        "turn_against_old_map_deg": improved.turn.turn_deg.tolist(),
        "turn_sigma_deg": improved.turn.sigma_deg,
        "old_map_scatter_deg": improved.turn.scatter_deg,
        "places_compared": improved.turn.places,
        "rows": [image_row(member) for member in improved.members],
        "left_out": [{"product": product, "reason": reason} for product, reason in improved.left_out],
    }


def image_row(member: Member) -> dict[str, Any]:
    """One image: what its orientation was turned by across the line of sight and about it, 1-sigma before and after
    (RMS of the two directions across the sight), places found and used, and their RMS."""
    across, about = turn_by_sight(member)
    fit = member.fit
    return {
        "product": member.product,
        "status": "improved" if fit else "too few places",
        "places": fit.places if fit else 0,
        "used": fit.used if fit else 0,
        "rms_px": fit.rms_px if fit else None,
        "turned_across_deg": across,
        "turned_about_deg": about,
        "sigma_before_deg": sigma_across_deg(member, member.prior),
        "sigma_after_deg": sigma_across_deg(member, member.covariance),
        **{
            f"attitude_{axis}_sigma_deg": float(sigma)
            for axis, sigma in zip("xyz", np.sqrt(np.diag(member.covariance)[ATTITUDE]), strict=True)
        },
    }


def turn_by_sight(member: Member) -> tuple[float, float]:
    """By how much the ground was turned under the camera, degrees: across the line of sight and about it."""
    turn = vector_deg_from_rotation(member.pose.camera_from_body.T @ member.before.camera_from_body)
    sight = member.before.spacecraft_in_body_km / member.before.range_km
    about = float(turn @ sight)
    return float(np.linalg.norm(turn - about * sight)), about


def sigma_across_deg(member: Member, covariance: Array) -> float:
    """1-sigma of the orientation across the line of sight, RMS of two directions, degrees."""
    sight = member.before.spacecraft_in_body_km / member.before.range_km
    across = np.eye(3) - np.outer(sight, sight)
    return float(np.sqrt(np.trace(across @ covariance[ATTITUDE, ATTITUDE] @ across) / 2))


def improved_table(report: dict[str, Any]) -> str:
    """The report for people."""
    x, y, z = report["turn_against_old_map_deg"]
    last = report["moves_in_sigmas"][-1] if report["moves_in_sigmas"] else 0.0
    lines = [
        f"{report['images']} images, {report['rounds']} rounds, last move {last:.2f} sigma "
        f"({'at rest' if report['settled'] else 'not at rest'}); {100 * report['shown']:.0f} % of the map seen",
        f"against the old map: turned by ({x:+.3f}, {y:+.3f}, {z:+.3f}) deg +- {report['turn_sigma_deg']:.3f}, places "
        f"differ by {report['old_map_scatter_deg']:.2f} deg (RMS); frame held by {report['frame_held_by']}",
        "image                  places   used  rms px  turned deg  sigma before  sigma after  status",
    ]
    for row in report["rows"]:
        rms = "-" if row["rms_px"] is None else f"{row['rms_px']:.3f}"
        lines.append(
            f"{row['product']:<22} {row['places']:>6} {row['used']:>6} {rms:>7}  {row['turned_across_deg']:>10.3f} "
            f"{row['sigma_before_deg']:>13.3f} {row['sigma_after_deg']:>12.3f}  {row['status']}"
        )
    return "\n".join(lines)
