"""Downstream photometry: choose regions over all images of a store, fit a phase function to each, write table and
figure."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from catalog.errors import PlanetposeError
from catalog.plain_files import own_json
from catalog.plain_text import printable
from tasks.boundary import reason_of, trouble_of
from tasks.export.pixels import Selection
from tasks.photometry.each_image import limb_weights
from tasks.photometry.fit import fit_law
from tasks.photometry.laws import PhotometricLaw, find_law
from tasks.photometry.region import OneImage, region_pixels, unreadable_products, usable_products
from tasks.photometry.regions import PhotometrySettings, RegionResult
from tasks.publish.contained import reading_product
from tasks.publish.cube import open_cube
from tasks.publish.names import CUBE

WHOLE, UNKNOWN = "region", "unknown"


def fit_store(
    store: Path, settings: PhotometrySettings, regions: Sequence[tuple[str, Selection]] = ()
) -> list[RegionResult]:
    """Fit every region (default: the settings' selection) over all usable images of `store`; a region that cannot be
    fitted says why and stops no other. Raises RefusedError for an unknown law, or a store without usable images."""
    law = find_law(settings.law)
    folders, broken = usable_products(store, settings.doubtful), unreadable_products(store)
    fitted = [
        _fit_region(f"{name} ({band})" if band else name, chosen, law, members, settings)
        for name, chosen in regions or [(WHOLE, settings.selection)]
        for band, members in by_band(folders, settings.bands).items()
    ]
    return [replace(result, left_out=(*broken, *result.left_out)) for result in fitted]


def by_band(folders: Sequence[Path], bands: str) -> dict[str, list[Path]]:
    """The products by filter or camera, as their cubes name it (`unknown` where one does not); all under an empty name
    for `none`."""
    found: dict[str, list[Path]] = {}
    for folder in folders:
        found.setdefault("" if bands == "none" else _band_of(folder, bands), []).append(folder)
    return dict(sorted(found.items()))


def _band_of(folder: Path, bands: str) -> str:
    try:
        with reading_product(folder), open_cube(folder / CUBE) as cube:
            attributes = dict(cube.attrs)
            if bands == "camera":
                return str(attributes.get("camera") or UNKNOWN)
            return str((own_json(attributes["provenance"]).get("image") or {}).get("filter") or UNKNOWN)
    except (PlanetposeError, KeyError, ValueError):
        return UNKNOWN  # the fit says why it cannot be read


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
