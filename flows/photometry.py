"""Downstream photometry: choose regions over all images of a store, fit a phase function to each, write table and
figure."""

import csv
import io
import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from catalog.errors import PlanetposeError, RefusedError
from catalog.plain_text import printable
from catalog.regular_file import read_regular_text
from flows.boundary import reason_of, trouble_of
from tasks.export.pixels import Selection
from tasks.photometry.each_image import ImageLimbWeight, limb_weights
from tasks.photometry.fit import FitSettings, PhotometricFit, fit_law
from tasks.photometry.laws import PhotometricLaw, find_law
from tasks.photometry.region import OneImage, RegionPixels, region_pixels, unreadable_products, usable_products

JSON_FILE, PARAMETERS, IMAGES = "photometry.json", "parameters.csv", "images.csv"
WHOLE = "region"
REGION_COLUMNS = ("region", "south", "north", "west", "east")


@dataclass(frozen=True)
class PhotometrySettings:
    """law: name. selection: region and limits of the angles. doubtful: doubtful images too. albedo_map: divide the
    products' base map out. fit: see there."""

    law: str = "lunar-lambert"
    selection: Selection = field(default_factory=lambda: Selection(max_incidence_deg=75.0, max_emission_deg=75.0))
    doubtful: bool = False
    albedo_map: bool = False
    max_pixels_per_image: int = 5_000
    fit: FitSettings = field(default_factory=FitSettings)


@dataclass(frozen=True)
class RegionResult:
    """One region: its pixels, the fit and L of each image, or the reason why there is none. left_out: products that
    could not be read, and why."""

    name: str
    selection: Selection
    pixels: RegionPixels | None = None
    fit: PhotometricFit | None = None
    each: tuple[ImageLimbWeight, ...] = ()
    reason: str | None = None
    left_out: tuple[tuple[str, str], ...] = ()


def fit_store(
    store: Path, settings: PhotometrySettings, regions: Sequence[tuple[str, Selection]] = ()
) -> list[RegionResult]:
    """Fit every region (default: the settings' selection) over all usable images of `store`; a region that cannot be
    fitted says why and stops no other. Raises RefusedError for an unknown law, or a store without usable images."""
    law = find_law(settings.law)
    folders, broken = usable_products(store, settings.doubtful), unreadable_products(store)
    fitted = [
        _fit_region(name, chosen, law, folders, settings) for name, chosen in regions or [(WHOLE, settings.selection)]
    ]
    return [replace(result, left_out=(*broken, *result.left_out)) for result in fitted]


def _fit_region(
    name: str, selection: Selection, law: PhotometricLaw, folders: Sequence[Path], settings: PhotometrySettings
) -> RegionResult:
    left_out: list[tuple[str, str]] = []

    def attempt(folder: Path, gather: Callable[[], OneImage | None]) -> OneImage | None:
        gathered: list[OneImage | None] = []
        error = trouble_of(lambda: gathered.append(gather()), folder.name)
        if error is not None:
            left_out.append((printable(folder.name), reason_of(error)))
            return None
        return gathered[0]

    try:
        pixels = region_pixels(folders, selection, settings.max_pixels_per_image, settings.albedo_map, attempt=attempt)
        fit = fit_law(law, pixels, settings.fit)
        return RegionResult(name, selection, pixels, fit, tuple(limb_weights(pixels)), left_out=tuple(left_out))
    except PlanetposeError as error:
        reason = left_out[0][1] if len(left_out) == len(folders) else error.reason
        return RegionResult(name, selection, reason=reason, left_out=tuple(left_out))


def read_regions(path: Path, limits: Selection) -> list[tuple[str, Selection]]:
    """Regions of a CSV file with the columns region, south, north, west, east (degrees, east positive); the other
    limits are those of `limits`. Raises RefusedError when the file has no such rows."""
    remedy = f"Give a CSV file with the columns {', '.join(REGION_COLUMNS)}."
    try:
        rows = list(csv.DictReader(io.StringIO(read_regular_text(path), newline="")))
        found = [
            (
                row["region"],
                replace(
                    limits,
                    latitude_deg=(float(row["south"]), float(row["north"])),
                    longitude_deg=(float(row["west"]), float(row["east"])),
                ),
            )
            for row in rows
        ]
    except (OSError, UnicodeDecodeError, csv.Error, KeyError, TypeError, ValueError) as error:
        raise RefusedError("regions-unreadable", f"{path} lists no regions ({error}).", remedy) from error
    if not found:
        raise RefusedError("regions-unreadable", f"{path} lists no regions.", remedy)
    return found


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
            "unit": known[name].unit if name in known else "image units per I/F",
            "how": "held" if name in fit.held else "at-bound" if name in fit.at_bound else "solved",
            "meaning": known[name].meaning if name in known else "brightness of a surface of I/F 1",
        }


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
    import numpy as np

    sigma = np.sqrt(np.maximum(np.diag(fit.covariance), 1e-300))
    return np.round(fit.covariance / np.outer(sigma, sigma), 4).tolist()


def write_photometry(
    results: Sequence[RegionResult], law: str, out: Path, tell: Callable[[Path], None] = lambda _: None
) -> list[Path]:
    """Write photometry.json, parameters.csv, images.csv and one PNG per fitted region into `out`; returns their
    paths."""
    from catalog.safe_name import safe_product_name
    from tasks.pictures.canvas import DRAWING
    from tasks.pictures.photometry_figure import photometry_figure

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
