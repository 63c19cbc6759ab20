"""STAC: an item per image and a collection of them, by pystac."""

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from catalog.target import Target
from tasks.atomic import folder_put_in_place
from tasks.export.footprint import footprint
from tasks.export.map_grid import MapGrid, body_crs
from tasks.export.map_image import finest_resolution_km
from tasks.export.settings import MAPS
from tasks.export.source import Source
from tasks.publish.extra_planes import EXTRA
from tasks.publish.names import CUBE, OVERLAY, RESULT

if TYPE_CHECKING:
    import pystac

SOLAR_SYSTEM = "https://stac-extensions.github.io/ssys/v1.1.1/schema.json"
LICENSE = "other"
MEDIA_TYPES = {
    ".zarr": "application/vnd.zarr; version=3",
    ".png": "image/png",
    ".json": "application/json",
    ".xml": "application/xml",
    ".tif": "image/tiff; application=geotiff",
    ".fits": "application/fits",
    ".csv": "text/csv",
    ".parquet": "application/vnd.apache.parquet",
}
COG_TYPE = "image/tiff; application=geotiff; profile=cloud-optimized"
ROLES = {CUBE: ["data"], EXTRA: ["data"], OVERLAY: ["overview", "thumbnail"], RESULT: ["metadata"]}


def stac_item(source: Source, exported: Mapping[str, Path], grid: MapGrid | None = None) -> "pystac.Item":
    """The item of one product: footprint on the body, time, view, target, and as assets the product's own files and
    those `exported` (by format). grid: that of the exported maps. Raises RefusedError as `footprint`."""
    import pystac
    from pystac.extensions.projection import ProjectionExtension
    from pystac.extensions.view import ViewExtension

    geometry, box, view = footprint(source)
    item = pystac.Item(
        source.product,
        geometry,
        box,
        datetime.fromisoformat(source.attributes["utc"].removesuffix("Z")).replace(tzinfo=UTC),
        {
            "title": source.attributes.get("title", source.product),
            "instruments": [source.camera.name],
            "gsd": finest_resolution_km(source) * 1e3,
            "ssys:targets": [source.target.name.capitalize()],
            "ssys:target_class": target_class(source.target),
        },
    )
    if source.camera.mission:
        item.properties["mission"] = source.camera.mission
    item.stac_extensions.append(SOLAR_SYSTEM)
    ViewExtension.ext(item, add_if_missing=True).apply(
        off_nadir=view.off_nadir_deg,
        incidence_angle=view.emission_deg,
        azimuth=view.spacecraft_azimuth_deg,
        sun_azimuth=view.sun_azimuth_deg,
        sun_elevation=90.0 - view.incidence_deg,
    )
    ProjectionExtension.ext(item, add_if_missing=True).apply(
        epsg=None, wkt2=body_crs(source.target).to_wkt("WKT2_2019"), bbox=box
    )
    for name in (CUBE, EXTRA, OVERLAY, RESULT):
        if (source.folder / name).exists():
            item.add_asset(name.partition(".")[0], _asset(source.folder / name, ROLES[name]))
    for kind, path in exported.items():
        asset = _asset(path, ["data"], COG_TYPE if kind == "cog" else None)
        item.add_asset(kind, asset)
        if grid is not None and kind in MAPS:
            asset.extra_fields |= grid_fields(grid)
    return item


def _asset(path: Path, roles: list[str], media_type: str | None = None) -> "pystac.Asset":
    import pystac

    return pystac.Asset(str(path.resolve()), media_type=media_type or MEDIA_TYPES.get(path.suffix), roles=roles)


def grid_fields(grid: MapGrid) -> dict[str, Any]:
    """Projection fields of one asset that holds a map, as the extension spells them."""
    crs, transform = grid.projection.crs, grid.transform
    x0, y1 = grid.x0_m, grid.y0_m
    return {
        "proj:code": None,
        "proj:wkt2": crs.to_wkt("WKT2_2019"),
        "proj:projjson": crs.to_json_dict(),
        "proj:shape": list(grid.shape),
        "proj:transform": list(transform)[:6],
        "proj:bbox": [x0, y1 - grid.shape[0] * grid.step_m, x0 + grid.shape[1] * grid.step_m, y1],
    }


def target_class(target: Target) -> str:
    """The body's class in the words of the IVOA, by its NAIF number."""
    if target.naif_id == 999:
        return "dwarf_planet"
    if target.naif_id > 1_000_000:
        return "comet" if target.naif_id < 2_000_000 else "asteroid"
    return "planet" if target.naif_id % 100 == 99 else "satellite"


def write_stac(items: Sequence["pystac.Item"], folder: Path, title: str) -> Path:
    """Write a self-contained static collection of `items` into `folder`, all or nothing; links are relative to it.
    Returns the path of collection.json."""
    import pystac

    boxes = [item.bbox for item in items if item.bbox]
    times = [item.datetime for item in items if item.datetime]
    whole = [min(b[0] for b in boxes), min(b[1] for b in boxes), max(b[2] for b in boxes), max(b[3] for b in boxes)]
    extent = pystac.Extent(pystac.SpatialExtent([whole]), pystac.TemporalExtent([[min(times), max(times)]]))
    targets = sorted({target for item in items for target in item.properties["ssys:targets"]})
    fields: dict[str, Any] = {"ssys:targets": targets}
    collection = pystac.Collection(
        title, "Images with corrected geometry, by planetpose.", extent, license=LICENSE, extra_fields=fields
    )
    collection.stac_extensions.append(SOLAR_SYSTEM)
    collection.add_items(items)
    folder = folder.resolve()
    collection.normalize_hrefs(str(folder))
    for item in items:
        item.make_asset_hrefs_relative()
    with folder_put_in_place(folder) as temporary:
        collection.save(pystac.CatalogType.SELF_CONTAINED, dest_href=str(temporary))
    return folder / "collection.json"
