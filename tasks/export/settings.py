"""Settings of an export."""

from dataclasses import dataclass, field

from catalog.errors import RefusedError
from tasks.export.map_grid import PROJECTIONS
from tasks.export.map_image import KERNELS
from tasks.export.pixels import Selection

FORMATS = ("fits", "geotiff", "cog", "zarr-map", "stac", "csv", "parquet", "isd", "isis-cube", "pds4", "pds4-map")
MAPS = ("geotiff", "cog", "zarr-map", "pds4-map")


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
