"""Export products into other tools' forms: one image after the other, then the catalog of them all."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from catalog.errors import RefusedError
from catalog.plain_text import printable
from flows.boundary import trouble_of
from flows.result import verdict
from tasks.export.map_grid import PROJECTIONS
from tasks.export.map_image import KERNELS
from tasks.export.pixels import Selection
from tasks.export.source import Source

if TYPE_CHECKING:
    import pystac

    from tasks.export.map_image import MapImage

FORMATS = ("fits", "geotiff", "cog", "zarr-map", "stac", "csv", "parquet")
MAPS = ("geotiff", "cog", "zarr-map")
STAC_FOLDER = "stac"


@dataclass(frozen=True)
class ExportSettings:
    """What to write. resolution_km, central_longitude_deg: None leaves the choice to `map_image`."""

    formats: tuple[str, ...]
    projection: str = "equirectangular"
    resolution_km: float | None = None
    central_longitude_deg: float | None = None
    kernel: str = "bilinear"
    max_emission_deg: float = 85.0
    selection: Selection = field(default_factory=Selection)

    def __post_init__(self) -> None:
        chosen = {
            "format": (self.formats, FORMATS),
            "projection": ((self.projection,), PROJECTIONS),
            "kernel": ((self.kernel,), KERNELS),
        }
        for what, (given, known) in chosen.items():
            unknown = [name for name in given if name not in known]
            if unknown or not given:
                fault = f"there is no {what} {', '.join(unknown)}." if unknown else f"no {what} is given."
                raise RefusedError(f"{what}-unknown", fault, f"Known are {', '.join(known)}.")


@dataclass
class Exported:
    """What became of one product: the files by format, and the reason where some or all could not be written."""

    product: str
    files: dict[str, Path] = field(default_factory=dict)
    reason: str | None = None
    status: str = "ok"

    def to_dict(self) -> dict[str, Any]:
        """As `--json` prints it."""
        files = {kind: str(path) for kind, path in self.files.items()}
        return {
            "product": self.product,
            "status": self.status,
            "reason": self.reason,
            "files": files,
        }


def export_products(
    folders: Iterable[Path], settings: ExportSettings, out: Path, tell: Callable[[Exported], None] = lambda _: None
) -> list[Exported]:
    """Export every product; one that cannot be does not stop the others."""
    items: list[pystac.Item] = []
    results: list[Exported] = []
    for folder in folders:
        result = Exported(printable(folder.name))
        if result.product in {done.product for done in results}:
            fault = f"{folder} has the name of another product of this command; its files would replace those."
            error: Exception | None = RefusedError("product-twice", fault, "Use another --out for one of them.")
        else:
            error = trouble_of(partial(_export, folder, settings, out, result, items), result.product)
        if error is not None:
            result.status, result.reason = error_of(error)
        results.append(result)
        tell(result)
    if items:
        from tasks.export.stac import write_stac

        write_stac(items, out / STAC_FOLDER, "planetpose")
    return results


def error_of(error: Exception) -> tuple[str, str]:
    """Status and reason."""
    told = verdict(error, [])
    return str(told["status"]), str(told["reason"])


def _export(folder: Path, settings: ExportSettings, out: Path, result: Exported, items: "list[pystac.Item]") -> None:
    from tasks.export.source import read_source

    source = read_source(folder)
    mapped = _mapped(source, settings)
    for kind in settings.formats:
        if kind != "stac":
            result.files[kind] = _write(kind, source, mapped, settings, out)
    if "stac" in settings.formats:
        from tasks.export.stac import stac_item

        items.append(stac_item(source, result.files, mapped.grid if mapped else None))
        result.files["stac"] = out / STAC_FOLDER / source.product / f"{source.product}.json"


def _mapped(source: Source, settings: ExportSettings) -> "MapImage | None":
    if not set(MAPS) & set(settings.formats):
        return None
    from tasks.export.map_image import map_image

    return map_image(
        source,
        settings.projection,
        settings.resolution_km,
        settings.central_longitude_deg,
        settings.kernel,
        settings.max_emission_deg,
    )


def _write(kind: str, source: Source, mapped: "MapImage | None", settings: ExportSettings, out: Path) -> Path:
    """Write one format and return its path."""
    if mapped is not None and kind in MAPS:
        from tasks.export.geotiff import write_geotiff
        from tasks.export.zarr_map import write_zarr_map

        name = f"{source.product}_{settings.projection}"
        if kind == "zarr-map":
            return write_zarr_map(source, mapped, out / f"{name}.zarr")
        suffix = "_cog.tif" if kind == "cog" else ".tif"
        return write_geotiff(source, mapped, out / f"{name}{suffix}", cloud_optimized=kind == "cog")
    if kind == "fits":
        from tasks.export.fits import write_backplanes

        return write_backplanes(source, out / f"{source.product}.fits")
    from tasks.export.pixels import pixel_table, write_table

    return write_table(pixel_table(source, settings.selection), out / f"{source.product}.{kind}")
