"""A mosaic in other forms: Cloud Optimized GeoTIFF and STAC item."""

import json
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from catalog.times import utc_from_et
from tasks.atomic import file_put_in_place
from tasks.export.cog import write_cog
from tasks.export.footprint import CELL_CENTRES, geometry_of
from tasks.export.map_grid import body_crs
from tasks.export.stac import COG_TYPE, MEDIA_TYPES, SOLAR_SYSTEM, grid_fields, target_class
from tasks.mosaic.build import Mosaic, cells_of
from tasks.mosaic.variables import INDEX, MAP
from tasks.publish.cube import open_cube, software_version

if TYPE_CHECKING:
    import xarray as xr

ROWS_AT_ONCE = 256
NAMES = [variable.name for variable in MAP]


def write_mosaic_cog(mosaic: Mosaic, path: Path, band: int | None = None) -> Path:
    """Write the layers of a mosaic (of its `band`, where it has some) as float32 bands with names and units, NaN as
    nodata; a strip of rows at a time. Returns `path`."""
    import rasterio
    from rasterio.windows import Window

    rows, columns = mosaic.grid.shape
    profile: dict[str, Any] = {
        "driver": "GTiff", "count": len(MAP), "dtype": "float32", "height": rows, "width": columns,
        "crs": rasterio.crs.CRS.from_wkt(mosaic.grid.grid.projection.crs.to_wkt("WKT2_2019")),
        "transform": mosaic.grid.grid.transform, "nodata": float("nan"),
    }  # fmt: skip

    def fill(file: Any) -> None:
        with open_cube(mosaic.path) as cube:
            for number, variable in enumerate(MAP, start=1):
                for top in range(0, rows, ROWS_AT_ONCE):
                    strip = slice(top, min(top + ROWS_AT_ONCE, rows))
                    window = Window(0, top, columns, strip.stop - strip.start)
                    file.write(_strip(cube, variable.name, strip, band), number, window=window)
                file.set_band_description(number, variable.name)
                file.set_band_unit(number, variable.units)
        file.update_tags(**_tags(mosaic, band))

    return write_cog(path, profile, fill, [NAMES.index(INDEX) + 1])


def _tags(mosaic: Mosaic, band: int | None) -> dict[str, str]:
    """What a reader of the GeoTIFF alone has to know, as text."""
    chosen = mosaic.settings
    tags = {
        "target": mosaic.target.name,
        "law": chosen.law,
        "reflectance_unit": mosaic.unit,
        "standard_incidence_emission_phase_deg": " ".join(f"{angle:g}" for angle in chosen.standard_deg),
        "latitude": "planetocentric",
        "longitude": "positive eastward",
        "images": " ".join(member.product for member in mosaic.members),
        "software": f"planetpose {software_version()}",
    }
    return tags if band is None else {**tags, "band": sorted(mosaic.models)[band]}


def _strip(cube: "xr.Dataset", name: str, rows: slice, band: int | None) -> Any:
    array = cube[name] if band is None else cube[name].isel(band=band)
    values = array[rows].values.astype(np.float32)
    if name == INDEX:
        values[values < 0] = np.nan
    return values


def write_mosaic_stac(mosaic: Mosaic, path: Path, cogs: dict[str, Path]) -> Path:
    """Write a STAC item of the mosaic and its files, and return `path`. Its outline is what the images may show of the
    map, in longitudes from -180 to 180, to whole cells of `tasks.export.footprint`."""
    import pystac
    from pystac.extensions.projection import ProjectionExtension

    times = sorted(member.utc_et for member in mosaic.members)
    start, end = (_time(et) for et in (times[0], times[-1]))
    geometry, box = geometry_of(_shown(mosaic))
    properties = {
        "title": f"Normalised reflectance of {mosaic.target.name}",
        "start_datetime": start.isoformat(),
        "end_datetime": end.isoformat(),
        "gsd": mosaic.grid.pixel_km * 1e3,
        "ssys:targets": [mosaic.target.name.capitalize()],
        "ssys:target_class": target_class(mosaic.target),
        "planetpose:law": mosaic.settings.law,
        "planetpose:images": [member.product for member in mosaic.members],
    }
    item = pystac.Item(path.name.split(".")[0], geometry, box, None, properties)
    item.stac_extensions.append(SOLAR_SYSTEM)
    wkt = body_crs(mosaic.target).to_wkt("WKT2_2019")
    ProjectionExtension.ext(item, add_if_missing=True).apply(epsg=None, wkt2=wkt, bbox=box)
    files = {"zarr": (mosaic.path, MEDIA_TYPES[".zarr"])} | {name: (cog, COG_TYPE) for name, cog in cogs.items()}
    for name, (file, kind) in files.items():
        relative = Path("..") / file.name if path.parent != file.parent else Path(file.name)
        asset = pystac.Asset(str(relative), media_type=kind, roles=["data"])
        if name != "zarr":
            asset.extra_fields |= {**grid_fields(mosaic.grid.grid), "bands": _bands()}
        item.add_asset(name, asset)
    with file_put_in_place(path) as temporary:
        temporary.write_text(json.dumps(item.to_dict(include_self_link=False), indent=1) + "\n", encoding="utf-8")
    return path


def _bands() -> list[dict[str, Any]]:
    """The bands of a mosaic's GeoTIFF, in STAC's common fields."""
    shared = {"data_type": "float32", "nodata": "nan"}
    return [{"name": each.name, "description": each.long_name, "unit": each.units, **shared} for each in MAP]


def _shown(mosaic: Mosaic) -> NDArray[np.bool_]:
    """Cells (CELL_CENTRES) of the body that an image may show and the map can."""
    latitude, longitude = np.meshgrid(*CELL_CENTRES, indexing="ij")
    x, _ = mosaic.grid.grid.projection.map_place(latitude, longitude)
    covered = np.any([member.coverage for member in mosaic.members], axis=0)
    return np.isfinite(x) & covered[cells_of(latitude, longitude % 360)].reshape(x.shape)


def _time(et: float) -> datetime:
    return datetime.fromisoformat(utc_from_et(et).removesuffix("Z")).replace(tzinfo=UTC)


def write_forms(mosaic: Mosaic, formats: tuple[str, ...]) -> list[Path]:
    """Write the other forms beside the Zarr group: `OUT.tif` (a file per band where there are bands) and `OUT.json`."""
    stem = mosaic.path.with_suffix("")
    cogs: dict[str, Path] = {}
    if "cog" in formats and mosaic.settings.bands == "none":
        cogs["cog"] = write_mosaic_cog(mosaic, stem.with_name(f"{stem.name}.tif"))
    elif "cog" in formats:
        for number, band in enumerate(sorted(mosaic.models)):
            cogs[f"cog-{band}"] = write_mosaic_cog(mosaic, stem.with_name(f"{stem.name}_{number}.tif"), number)
    written = list(cogs.values())
    if "stac" in formats:
        written.append(write_mosaic_stac(mosaic, stem.with_name(f"{stem.name}.json"), cogs))
    return written


def mosaic_summary(mosaic: Mosaic) -> dict[str, Any]:
    """Plain values of what was made, as `--json` prints them."""
    return {
        "path": str(mosaic.path),
        "images": [member.product for member in mosaic.members],
        "unit": mosaic.unit,
        "shape": list(mosaic.grid.shape),
        "pixel_km": mosaic.grid.pixel_km,
        "left_out": [{"product": product, "reason": reason} for product, reason in mosaic.left_out],
        "bands": {
            band: {
                "law": model.law.name,
                "parameters": model.values,
                "sigma": model.sigma,
                "levels": dict(zip(_products(mosaic, band), model.levels.tolist(), strict=True)),
                "scatter": model.scatter,
            }
            for band, model in mosaic.models.items()
        },
    }


def _products(mosaic: Mosaic, band: str) -> list[str]:
    return [mosaic.members[number].product for number in mosaic.numbers_in(band)]


def mosaic_text(mosaic: Mosaic) -> str:
    """The same for people."""
    rows, columns = mosaic.grid.shape
    lines = [f"{mosaic.path}: {rows}x{columns} pixels of {mosaic.grid.pixel_km:.3g} km, {len(mosaic.members)} images"]
    lines.append(f"  reflectance at incidence, emission, phase {mosaic.settings.standard_deg} deg, unit {mosaic.unit}")
    for band, model in mosaic.models.items():
        name = "" if mosaic.settings.bands == "none" else f"{band}: "
        spread = 100 * float(np.std(np.log(model.levels)))
        lines.append(f"  {name}{model.law.name}; levels spread by {spread:.2g} %, scatter {100 * model.scatter:.2g} %")
        for parameter in model.law.parameters:
            if parameter.name == "albedo":
                continue
            sigma = model.sigma.get(parameter.name)
            error = "held" if sigma is None else f"+- {sigma:.2g}"
            lines.append(
                f"    {parameter.name:20} {model.values[parameter.name]:.5g} {error} {parameter.unit}".rstrip()
            )
    return "\n".join(lines)
