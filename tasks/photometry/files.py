"""The files of a photometric fit: photometry.json, two tables, a figure per region."""

import csv
import json
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from catalog.safe_name import safe_product_name
from tasks.photometry.fit import SCALE, PhotometricFit
from tasks.photometry.laws import IMAGE_UNITS, RADIANCE_FACTOR, find_law
from tasks.photometry.region import RegionPixels
from tasks.photometry.regions import RegionResult

JSON_FILE, PARAMETERS, IMAGES = "photometry.json", "parameters.csv", "images.csv"


def in_json(result: RegionResult, law: str) -> dict[str, Any]:
    """Plain values of one region, as `photometry.json` and `--json` have them."""
    chosen = result.selection
    head = {
        "region": result.name,
        "law": law,
        "status": "failed" if result.fit is None else "ok",
        "reason": result.reason,
        "latitude_deg": list(chosen.latitude_deg),
        "longitude_deg": list(chosen.longitude_deg),
        "outline": chosen.outline.as_geojson() if chosen.outline else None,
        "max_incidence_deg": chosen.max_incidence_deg,
        "max_emission_deg": chosen.max_emission_deg,
        "left_out": [{"product": product, "reason": reason} for product, reason in result.left_out],
    }
    fit, pixels = result.fit, result.pixels
    if fit is None or pixels is None:
        return {**head, "parameters": [], "images": []}
    return {
        **head,
        "parameters": list(_parameters(fit)),
        "correlation": {"names": list(fit.names), "matrix": _correlation(fit)},
        "uncertainty_from": fit.method,
        "pixels": len(pixels.value),
        "patches_of_ground": fit.tiles,
        "images": list(_images(result, pixels, fit)),
    }


def _parameters(fit: PhotometricFit) -> Iterable[dict[str, Any]]:
    known = {p.name: p for p in find_law(fit.law).parameters}
    for name, value in fit.values.items():
        free = name in fit.sigma and name not in fit.at_bound
        yield {
            "name": name,
            "value": value,
            "sigma": fit.sigma[name] if free else None,
            "unit": unit_of(name, fit),
            "how": "held" if name in fit.held else "at-bound" if name in fit.at_bound else "solved",
            "meaning": known[name].meaning if name in known else "brightness of a surface of I/F 1",
        }


def unit_of(name: str, fit: PhotometricFit) -> str:
    """Unit of a parameter; an albedo is I/F where the images' scale is known, else in image units: those of the source
    file, DN or what it was calibrated to."""
    law = find_law(fit.law)
    if name == SCALE:
        return f"{IMAGE_UNITS} per {RADIANCE_FACTOR}"
    if name == "albedo":
        return RADIANCE_FACTOR if fit.absolute else IMAGE_UNITS
    return {p.name: p.unit for p in law.parameters}.get(name, "")


def _images(result: RegionResult, pixels: RegionPixels, fit: PhotometricFit) -> Iterable[dict[str, Any]]:
    for i, product in enumerate(pixels.products):
        yield {
            "product": product,
            "phase_deg": pixels.mean_phase_deg(i),
            "pixels_seen": pixels.seen[i],
            "pixels_used": int((pixels.image == i).sum()),
            "factor": float(fit.calibration[i]),
            "factor_sigma": float(fit.calibration_sigma[i]),
            "residual_rms": float(fit.rms[i]),
            "limb_weight_alone": result.each[i].value,
            "limb_weight_alone_sigma": result.each[i].sigma,
        }


def _correlation(fit: PhotometricFit) -> list[list[float]]:
    sigma = np.sqrt(np.maximum(np.diag(fit.covariance), 1e-300))
    return np.round(fit.covariance / np.outer(sigma, sigma), 4).tolist()


def write_photometry(
    results: Sequence[RegionResult], law: str, out: Path, tell: Callable[[Path], None] = lambda _: None
) -> list[Path]:
    """Write photometry.json, parameters.csv, images.csv and one PNG per fitted region into `out`; returns their
    paths."""
    from tasks.photometry.figure import photometry_figure
    from tasks.pictures.canvas import DRAWING

    out.mkdir(parents=True, exist_ok=True)
    content = [in_json(result, law) for result in results]
    paths = [out / JSON_FILE, out / PARAMETERS, out / IMAGES]
    paths[0].write_text(json.dumps(content, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    for path, key in ((paths[1], "parameters"), (paths[2], "images")):
        _write_table(path, [{"region": each["region"], **row} for each in content for row in each[key]])
    for result in results:
        if result.fit is not None and result.pixels is not None:
            path = out / f"{safe_product_name(result.name)}.png"
            with DRAWING:
                photometry_figure(result.name, result.pixels, result.fit, result.each).savefig(path, format="png")
            paths.append(path)
    for path in paths:
        tell(path)
    return paths


def _write_table(path: Path, rows: Sequence[dict[str, Any]]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        if rows:
            writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)
