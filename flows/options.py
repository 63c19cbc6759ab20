"""What users choose: one model per command, which is also the parameter of the Prefect flow of the same name.

A field's description, bounds and default are the command line's and those of Prefect's page; `Cli` adds what only a
command line needs. Nothing heavy is imported here, so that `--help` comes at once.
"""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, FiniteFloat

from catalog.settings import DEFAULT_PROFILE, cache_folder

BOOKS = ".reprocess"  # hidden: no product is called so, and the store's index passes it over


@dataclass(frozen=True)
class Cli:
    """How the command line spells a field. names: of the option, where they are not the field's; argument: it has no
    name; metavar: in the help; text: its value is one text; folder: it must be a folder that is there."""

    names: tuple[str, ...] = ()
    argument: bool = False
    metavar: str | None = None
    text: bool = False
    folder: bool = False


def opt(description: str, default: Any = None, **bounds: Any) -> Any:
    """A field with its help; `...` for one that must be given."""
    return Field(default, description=description, **bounds)


def two_numbers(given: Any) -> Any:
    """`DX,DY` as two numbers. Raises ValueError for a text that is something else."""
    if not isinstance(given, str):
        return given
    try:
        x, y = (float(part) for part in given.split(","))
    except ValueError as error:
        raise ValueError(f"{given!r} is not two numbers.") from error
    if not isfinite(x) or not isfinite(y):
        raise ValueError(f"{given!r} is not finite.")
    return x, y


def comma_list(given: Any) -> Any:
    """`a, b` as a list."""
    return [part.strip() for part in given.split(",")] if isinstance(given, str) else given


def known_flip(name: str | None) -> str | None:
    """The name of a way to flip a picture. Raises ValueError for another."""
    from catalog.flips import PLACES

    if name is not None and name not in PLACES:
        raise ValueError(f"{name!r} is none of {', '.join(PLACES)}.")
    return name


def absolute(path: Path) -> Path:
    """The path that means the same in every process."""
    return path.expanduser().absolute()


def name_or_file(text: str) -> str:
    """A name of the catalog as it is, a file with its absolute path."""
    return str(Path(text).absolute()) if Path(text).is_file() else text


Absolute = Annotated[Path, AfterValidator(absolute)]
NameOrFile = Annotated[str, AfterValidator(name_or_file)]
Paths = Annotated[tuple[Path, ...], Cli(argument=True), Field(description="Products' folders, or stores.")]
OneStore = Annotated[Path, Cli(argument=True, folder=True)]
Store = Annotated[str, Field(description="Folder that products are published in, or s3://bucket/prefix.")]
Limits = tuple[FiniteFloat, FiniteFloat]
Text = str | None
File = Path | None
LATITUDES, LONGITUDES = (-90.0, 90.0), (0.0, 360.0)


class Options(BaseModel):
    """What every command's options are: frozen, and no others."""

    model_config = ConfigDict(frozen=True, extra="forbid", validate_default=True, defer_build=True)


class KernelOptions(Options):
    """Which SPICE kernels are used."""

    kernels: tuple[Path, ...] | None = opt("SPICE kernel, meta-kernel or folder; repeat for more.")
    no_kernels: bool = opt("Use no kernels, not even default ones.", False)

    @property
    def chosen_kernels(self) -> tuple[Path, ...] | None:
        """The kernels; None for those of the environment."""
        return () if self.no_kernels else self.kernels or None


class ImageOptions(Options):
    """What may be given for an image, beside what its file says."""

    camera: Text = opt("Camera name, or FILE.toml; overrides the label.")
    target: Text = opt("Target name, or FILE.toml; overrides the label.")
    pose_file: Annotated[File, Cli(("--pose",))] = opt("Pose file (JSON); overrides kernels and label.")
    basemap: Annotated[File, Cli(("--map",))] = opt("Base map: an equirectangular picture of the whole body; or none.")
    map_left_edge_deg: float = opt("East longitude of the map's left edge.", 0.0, ge=-360, le=360)
    shape: File = opt("Shape model in km for the planes: DSK kernel, OBJ or PLY.")
    start_offset_px: Annotated[
        Limits | None, BeforeValidator(two_numbers), Cli(("--start-offset",), metavar="DX,DY", text=True)
    ] = opt("Pixels added to the predicted centre; no search of the frame.")
    mask: File = opt("Picture of the raw image's size; not 0: do not use the pixel.")
    flip: Annotated[Text, AfterValidator(known_flip), Cli(metavar="HOW")] = opt(
        "The picture is mirrored or turned: x, y, rot90, rot180, ... (see docs)."
    )
    resume: File = opt("Product folder, result.json or store to start from.")


class CorrectOptions(ImageOptions, KernelOptions):
    """Correct the geometry of images and publish cubes."""

    files: Annotated[tuple[Path, ...], Cli(argument=True)] = opt("Image files.", ...)
    store: Store = "out"
    product: Annotated[tuple[str, ...], Cli(metavar="NAME")] = opt(
        "Name of the product instead of the file's; once for each file.", ()
    )
    profile: str = opt("Which bricks: a name, or FILE.toml.", DEFAULT_PROFILE)
    hold: Annotated[tuple[str, ...], BeforeValidator(comma_list), Cli(metavar="GROUPS", text=True)] = opt(
        "Do not change: range, attitude, roll, offset, psf (comma list).", ()
    )
    max_passes: int | None = opt("Overrides the profile's passes.", ge=1, le=10)
    workers: int | None = opt("Images at a time; default: one per processor.", ge=1)

    def of(self, positions: Sequence[int], workers: int) -> "CorrectOptions":
        """The options of some of the files."""
        names = tuple(self.product[i] for i in positions) if self.product else ()
        files = tuple(self.files[i] for i in positions)
        return self.model_copy(update={"files": files, "product": names, "workers": workers})


class ReprocessOptions(Options):
    """Correct the images of a list that are new or whose inputs, settings, kernels or code changed."""

    images: Annotated[NameOrFile, Cli(argument=True)] = opt(
        "Image list: a name of the catalog, or a CSV, TOML or Parquet file.", ..., min_length=1
    )
    store: Annotated[Store, AfterValidator(lambda text: text if "://" in text else str(absolute(Path(text))))] = "out"
    profile: NameOrFile = opt("Which bricks: a name, or FILE.toml.", DEFAULT_PROFILE)
    only: tuple[str, ...] = opt("Products like this (C16*); repeat for more.", ())
    kernels: tuple[Path, ...] | None = opt("SPICE kernels for images whose list names none; repeat for more.")
    workers: int = opt("Images at a time; 0: one per processor.", 0, ge=0)
    runner: str = opt("Where images are done: threads (this machine), dask, or dask:ADDRESS of a scheduler.", "threads")
    dry_run: bool = opt("Only tell what would be done, and why.", False)
    force: bool = opt("Also images that are unchanged; cached steps stay.", False)
    again: bool = opt("Also images that were refused or failed before.", False)
    verify: bool = opt("Compare every product with its checksums.", False)
    image_timeout_s: float = opt("Seconds that one image may take.", 1800.0, ge=0.1)
    image_memory_mb: float = opt("Memory that one image may take.", 6000.0, ge=50)
    retries: int = opt("After faults that can pass.", 2, ge=0, le=20)
    retry_delay_s: float = opt("Before the first; each further one is tripled.", 10.0, ge=0)
    most_failed_percent: float = opt("More failed images make the flow fail and raise the alarm.", 5.0, ge=0, le=100)
    fetch: bool = opt("First get what the list names and is not there.", False)
    archive: Absolute | None = opt("Folder of fetched files (default: PLANETPOSE_ARCHIVE).")
    cache: Absolute | None = opt("Folder of cached steps (default: PLANETPOSE_CACHE).")
    cache_limit_gb: float | None = opt("Prune the cache of steps to this size.", ge=0)
    cache_days: float | None = opt("Prune what was not used for so long.", ge=0)

    @property
    def folder(self) -> Path:
        """The folder that products are made in: the store, or the local one before an object store."""
        from flows.places import place_of

        return place_of(self.store).store

    @property
    def steps_cache(self) -> Path:
        """Folder of cached steps."""
        return self.cache or cache_folder().absolute()

    @property
    def books(self) -> Path:
        """Folder of what is remembered about images and runs."""
        return self.folder / BOOKS

    @property
    def at_a_time(self) -> int:
        """Images at a time."""
        return self.workers or processors()

    @property
    def delays_s(self) -> list[float]:
        """Seconds before each retry."""
        return [self.retry_delay_s * 3**number for number in range(self.retries)]


class FetchOptions(Options):
    """Get the images, labels, kernels and maps of a list; exit status 1 when a file could not be had."""

    catalog: Annotated[str, Cli(argument=True)] = opt("An image list: a name of the catalog, or a file.", ...)
    only: tuple[str, ...] = opt("Products alone that match this pattern (C16*); repeat.", ())
    what: tuple[str, ...] = opt("images, labels, kernels or maps; repeat. Default: all.", ())
    mirror: Text = opt("URL or folder in place of all archives (PLANETPOSE_MIRROR).")
    dest: File = opt("Folder of fetched files (PLANETPOSE_ARCHIVE).")
    attempts: int = opt("Attempts per file.", 4, ge=1, le=20)
    stall_s: float = opt("Silence that ends an attempt.", 30.0, ge=0.1)
    requests_per_s: float = opt("To one host.", 4.0, ge=0.01)
    largest_mb: float = opt("Largest file that is fetched.", 2000.0, ge=0.001)


class ExportOptions(Options):
    """Export products for other tools: backplanes, maps, catalog items, tables of pixels."""

    paths: Paths
    format: Annotated[tuple[str, ...], Cli(("--format", "-f"))] = opt(
        "fits, geotiff, cog, zarr-map, stac, csv, parquet; repeat for more.", ..., min_length=1
    )
    out: Path = opt("Folder that files are written into.", Path("export"))
    projection: str = opt("Maps: equirectangular, orthographic or polar-stereographic.", "equirectangular")
    resolution_km: Annotated[float | None, Cli(("--resolution-km", "--resolution"))] = opt(
        "Maps: km per pixel; default: the image's."
    )
    central_longitude_deg: float | None = opt("Maps: middle of an equirectangular one, lower meridian of a polar one.")
    kernel: str = opt("Maps: nearest, bilinear or cubic.", "bilinear")
    max_emission_deg: float | None = opt("Maps and tables: no farther to the limb; default 85 and 90.", ge=0, le=90)
    max_incidence_deg: float = opt("Tables.", 90.0, ge=0, le=180)
    latitude: Limits = opt("Tables: south and north limit.", LATITUDES)
    longitude: Limits = opt("Tables: west and east limit, east positive; may run through 0.", LONGITUDES)
    every_flag: bool = opt("Tables: flagged pixels on the body too.", False)


class ReportOptions(Options):
    """Write a store as static HTML: sortable table, distributions per camera, a page with pictures for every image."""

    store: OneStore = opt("A store.", ...)
    out: Path = opt("Folder for index.html, pages and pictures.", Path("out/report"))
    picture: tuple[str, ...] = opt("overlay, residual, planes, limb; repeat for more. Default: the first three.", ())


class KernelsOptions(KernelOptions):
    """Write corrected SPICE kernels: camera orientation, spacecraft position, target attitude, meta-kernels."""

    paths: Paths
    out: Path = opt("Folder that the sets are written in, a folder each.", Path("kernels"))
    per_image: bool = opt("A set per image instead of one per mission.", False)
    check: bool = opt("Compare with plain SPICE in a second process.", True)


class PhotometryOptions(Options):
    """Fit a phase function to a region's pixels in all images of a store."""

    store: OneStore = opt("A store, or one product's folder.", ...)
    law: str = opt("lunar-lambert or hapke.", "lunar-lambert")
    latitude: Limits = opt("South and north limit.", LATITUDES)
    longitude: Limits = opt("West and east limit, east positive; may run through 0.", LONGITUDES)
    regions: File = opt("CSV file of regions instead: region, south, north, west, east.")
    max_incidence_deg: float = Field(75.0, ge=0, le=90)
    max_emission_deg: float = Field(75.0, ge=0, le=90)
    hold: Annotated[tuple[str, ...], Cli(metavar="NAME=VALUE")] = opt(
        "A parameter that is not solved; repeat for more.", ()
    )
    calibration_percent: float = opt(
        "1-sigma of the images' calibration against each other; 0: it is exact.", 5.0, ge=0
    )
    units_per_if: float | None = opt(
        "Hapke: image units per I/F; without it w comes from the brightness' shape alone.", ge=1e-12
    )
    albedo_map: bool = opt("Divide out the base map that the products were made with.", False)
    doubtful: bool = opt("Doubtful images too.", False)
    bootstrap: int = opt("Uncertainties from that many fits to ground drawn anew; 0: from the covariance.", 0, ge=0)
    max_pixels: int = opt("Pixels per image; of more every k-th is used.", 5_000, ge=100)
    out: Path = opt("Folder for tables and figures.", Path("photometry"))


class AdjustOptions(Options):
    """Solve for what images share: constants of cameras, attitude and range bias of sequences."""

    store: Annotated[Path, Cli(argument=True)] = opt("Store of images that the joint step corrected.", ...)
    out: File = opt("Folder for adjust.json and a pose file per image.")
    gap: float = opt("Longest pause within a sequence, seconds.", 300.0, ge=0.001)


class CheckOptions(Options):
    """Check published products: checksums, schema, values, provenance, and geometry against their own pose."""

    paths: Annotated[tuple[str, ...], Cli(argument=True)] = opt(
        "Stores, or products' folders; stores may be s3://bucket/prefix.", ...
    )


def processors() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
