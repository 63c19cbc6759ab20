"""Write a product in one of the formats of `ExportSettings`."""

from pathlib import Path
from typing import TYPE_CHECKING

from tasks.export.settings import MAPS, ExportSettings
from tasks.export.source import Source

if TYPE_CHECKING:
    from tasks.export.map_image import MapImage


def mapped(source: Source, settings: ExportSettings) -> "MapImage | None":
    """The map-projected image, where a format that needs it is wanted."""
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


def write_one(kind: str, source: Source, mapped: "MapImage | None", settings: ExportSettings, out: Path) -> Path:
    """Write one format and return its path."""
    if mapped is not None and kind in MAPS:
        from tasks.export.geotiff import write_geotiff
        from tasks.export.zarr_map import write_zarr_map

        name = f"{source.product}_{settings.projection}"
        if kind == "zarr-map":
            return write_zarr_map(source, mapped, out / f"{name}.zarr")
        if kind == "pds4-map":
            from tasks.export.pds4 import file_stem, write_pds4_map

            return write_pds4_map(source, mapped, out / f"{file_stem(name)}_pds4.xml")
        suffix = "_cog.tif" if kind == "cog" else ".tif"
        return write_geotiff(source, mapped, out / f"{name}{suffix}", cloud_optimized=kind == "cog")
    if kind == "fits":
        from tasks.export.fits import write_backplanes

        return write_backplanes(source, out / f"{source.product}.fits")
    if kind == "isd":
        from tasks.export.isd import write_isd

        return write_isd(source, out / f"{source.product}_isd.json")
    if kind == "pds4":
        from tasks.export.pds4 import file_stem, write_pds4

        return write_pds4(source, out / f"{file_stem(source.product)}.xml")
    if kind == "isis-cube":
        from tasks.export.isis_cube import write_isis_cube

        return write_isis_cube(source, out / f"{source.product}.cub")
    from tasks.export.pixels import pixel_table, write_table

    return write_table(pixel_table(source, settings.selection), out / f"{source.product}.{kind}")
