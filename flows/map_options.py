"""What users choose of the commands that make maps and laws of a store's images; as `flows.options`."""

from pathlib import Path
from typing import Annotated

from pydantic import BeforeValidator

from flows.image_options import Cli, File, Limits, Options, Text, opt
from flows.options import LATITUDES, LONGITUDES, OneStore, comma_list
from flows.star_options import Solvable


class PhotometryOptions(Options):
    """Fit a phase function to a region's pixels in all images of a store."""

    store: OneStore = opt(..., description="A store, or one product's folder.")
    law: str = opt(
        "lunar-lambert",
        description="lambert, lommel-seeliger, lunar-lambert, mcewen, minnaert, akimov, hapke, hapke-2002, hapke-2012.",
    )
    latitude: Limits = opt(LATITUDES, description="South and north limit.")
    longitude: Limits = opt(LONGITUDES, description="West and east limit, east positive; may run through 0.")
    regions: File = opt(description="Regions: CSV (region, south, north, west, east) or GeoJSON with polygons.")
    west_longitudes: bool = opt(False, description="The longitudes in that file are positive westward.")
    max_incidence_deg: float = opt(75.0, ge=0, le=90, description="Pixels with a larger angle are not used.")
    max_emission_deg: float = opt(75.0, ge=0, le=90, description="Pixels with a larger angle are not used.")
    hold: Annotated[tuple[str, ...], Cli(metavar="NAME=VALUE")] = opt(
        (), description="A parameter that is held; repeat for more."
    )
    prior: Annotated[tuple[str, ...], Cli(metavar="NAME=VALUE+-SIGMA")] = opt(
        (), description="Prior of a parameter, with its 1-sigma; repeat for more."
    )
    bound: Annotated[tuple[str, ...], Cli(metavar="NAME=LOW:HIGH")] = opt(
        (), description="Limits of a parameter; repeat for more."
    )
    calibration_percent: float = opt(
        5.0, ge=0, description="1-sigma of the images' calibration against each other; 0: it is exact."
    )
    units_per_if: float | None = opt(
        ge=1e-12, description="Image units per I/F; default: albedos in image units, and Hapke's w from the shape."
    )
    bands: str = opt("none", description="A separate fit for each: none, filter or camera.")
    albedo_map: bool = opt(False, description="Divide by the base map with which the products were made.")
    doubtful: bool = opt(False, description="Also use doubtful images.")
    bootstrap: int = opt(
        0, ge=0, description="Uncertainties from this number of fits to resampled ground; 0: from the covariance."
    )
    max_pixels: int = opt(5_000, ge=100, description="Largest number of pixels per image; of more, every k-th is used.")
    out: Path = opt(Path("photometry"), description="Folder for tables and figures.")


class MosaicOptions(Options):
    """Combine the images of a store into a map of normalised reflectance with its errors."""

    store: OneStore = opt(..., description="A store.")
    out: Path = opt(Path("map.zarr"), description="Zarr group for the map.")
    law: str = opt("hapke", description="Photometric law, as of `planetpose photometry`.")
    hold: Annotated[tuple[str, ...], Cli(metavar="NAME=VALUE")] = opt(
        (), description="A parameter of the law that is held; repeat for more."
    )
    prior: Annotated[tuple[str, ...], Cli(metavar="NAME=VALUE+-SIGMA")] = opt(
        (), description="Prior of a parameter; repeat for more."
    )
    projection: str = opt("equirectangular", description="equirectangular, orthographic or polar-stereographic.")
    resolution: str = opt("4ppd", description="Pixels per degree (4ppd) or size of a pixel (10km, 500m).")
    central_longitude_deg: float | None = opt(description="Central longitude of an equirectangular map; default 180.")
    bands: str = opt("none", description="A separate map for each: none, filter or camera.")
    max_incidence_deg: Annotated[float, Cli(("--max-incidence-deg", "--max-incidence"))] = opt(
        75.0, ge=1, le=89, description="Pixels with a larger angle are not used."
    )
    max_emission_deg: Annotated[float, Cli(("--max-emission-deg", "--max-emission"))] = opt(
        75.0, ge=1, le=89, description="Pixels with a larger angle are not used."
    )
    weights: str = opt("sigma-resolution", description="sigma-resolution, sigma, resolution or equal.")
    calibration_percent: float | None = opt(
        ge=0.01, description="1-sigma of the images' calibration against each other; default: unknown."
    )
    units_per_if: float | None = opt(ge=1e-12, description="Image units per I/F; default: the map is in image units.")
    doubtful: bool = opt(False, description="Also use doubtful images.")
    format: Annotated[tuple[str, ...], Cli(("--format", "-f"))] = opt(
        (), description="Further formats: cog, stac; repeat for more."
    )
    memory_mb: float = opt(256.0, ge=8, description="Memory for the values of the images in one block of the map.")
    scheduler: Text = opt(description="Address of a Dask scheduler; default: threads of this process.")


class ControlOptions(Options):
    """Tie the images of a store to each other, and adjust all poses together."""

    store: OneStore = opt(..., description="A store.")
    out: Path = opt(Path("control"), description="Folder for the network, poses, tables and kernels.")
    points: int = opt(1200, ge=20, le=200_000, description="Number of places on the body to try.")
    patch_px: int = opt(21, ge=7, le=101, description="Side of a patch, odd; pixels of the coarser image.")
    search_px: int = opt(4, ge=1, le=40, description="Largest distance of a match from its predicted place, pixels.")
    least_correlation: float = opt(0.8, ge=0.3, le=0.99, description="Smallest correlation of a match.")
    law: str = opt("lunar-lambert", description="Photometric law by which patches are divided.")
    least_attitude_deg: float = opt(
        0.0, ge=0, description="Smallest 1-sigma of the body's orientation; smaller stated values are raised to it."
    )
    free_radius: bool = opt(False, description="Points may lie above or below the shape.")
    reject_sigma: float = opt(4.0, ge=2, description="Ties with larger residuals are rejected.")
    solve: Annotated[tuple[Solvable, ...], BeforeValidator(comma_list), Cli(metavar="WHAT,...", text=True)] = opt(
        (), description="Of each camera, by all its images: focal-length, distortion (what its model leaves)."
    )
    kernels: bool = opt(False, description="Also write SPICE kernels of the adjusted poses.")
    doubtful: bool = opt(False, description="Also use doubtful images.")


class ImproveMapOptions(Options):
    """Make a base map from the images of a store and correct their orientations with it, in turn."""

    store: OneStore = opt(..., description="A store.")
    out: Path = opt(Path("improved.tif"), description="GeoTIFF of the base map; other files go beside it.")
    map: File = opt(description="Base map that the images were corrected with; default: the catalog's.")
    map_left_edge_deg: float = opt(0.0, ge=-360, le=360, description="East longitude of that map's left edge.")
    resolution: str = opt("4ppd", description="Pixels per degree (4ppd) or size of a pixel (10km, 500m).")
    law: str = opt("lunar-lambert", description="Photometric law, as of `planetpose mosaic`.")
    hold_frame: str = opt("map", description="What fixes the common frame of all images: map, rotation or feature.")
    feature: Annotated[tuple[str, ...], Cli(metavar="NAME:LAT,LON")] = opt(
        (), description="Its longitude holds the frame; @LAT,LON after it: where the old map shows it. Repeat for more."
    )
    rounds: int = opt(5, ge=0, le=50, description="Rounds of mosaic and orientations, at most.")
    still: float = opt(0.1, gt=0, le=1, description="End when orientations change by less (median, in sigmas).")
    points: int = opt(2400, ge=100, le=200_000, description="Places on the body that are tried in every image.")
    least_correlation: float = opt(0.7, ge=0.3, le=0.99, description="Smallest correlation of a match.")
    max_incidence_deg: Annotated[float, Cli(("--max-incidence-deg", "--max-incidence"))] = opt(
        75.0, ge=1, le=89, description="Pixels with a larger angle are not used."
    )
    max_emission_deg: Annotated[float, Cli(("--max-emission-deg", "--max-emission"))] = opt(
        75.0, ge=1, le=89, description="Pixels with a larger angle are not used."
    )
    doubtful: bool = opt(False, description="Also use doubtful images.")
