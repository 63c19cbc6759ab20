"""What users choose: one model per command, whose fields are also the parameters of the Prefect flow of that name.

See `flows.image_options` for what their fields have. Nothing heavy is imported here either.
"""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator, BeforeValidator

from catalog.lists.location import address_in
from catalog.lists.part import checked_part
from catalog.settings import DEFAULT_PROFILE, cache_folder, shared_cache_url
from flows.image_options import Cli, File, ImageOptions, Limits, Options, Text, opt
from flows.option_types import Absolute, Folder, NameOrFile, OneStore, Paths, Store, absolute, comma_list

BOOKS = ".reprocess"  # hidden: no product is called so, and the store's index passes it over


LATITUDES, LONGITUDES = (-90.0, 90.0), (0.0, 360.0)


class KernelOptions(Options):
    """Which SPICE kernels are used."""

    kernels: tuple[Path, ...] | None = opt(description="SPICE kernel, meta-kernel or folder; repeat for more.")
    no_kernels: bool = opt(False, description="Use no kernels, not even default ones.")

    @property
    def chosen_kernels(self) -> tuple[Path, ...] | None:
        """The kernels; None for those of the environment."""
        return () if self.no_kernels else self.kernels or None


class CorrectOptions(ImageOptions, KernelOptions):
    """Correct the geometry of images and publish cubes."""

    files: Annotated[tuple[Path, ...], Cli(argument=True)] = opt(..., description="Image files.")
    store: Store = "out"
    product: Annotated[tuple[str, ...], Cli(metavar="NAME")] = opt(
        (), description="Name of the product, in place of the file's name; once for each file."
    )
    profile: str = opt(DEFAULT_PROFILE, description="Methods and settings of the steps: a name, or FILE.toml.")
    hold: Annotated[tuple[str, ...], BeforeValidator(comma_list), Cli(metavar="GROUPS", text=True)] = opt(
        (), description="Do not change: range, attitude, roll, offset, psf (comma list)."
    )
    max_passes: int | None = opt(ge=1, le=10, description="Number of passes; overrides the profile.")
    workers: int | None = opt(ge=1, description="Images at a time; default: one per processor.")

    def of(self, positions: Sequence[int], workers: int) -> "CorrectOptions":
        """The options of some of the files."""
        names = tuple(self.product[i] for i in positions) if self.product else ()
        files = tuple(self.files[i] for i in positions)
        return self.model_copy(update={"files": files, "product": names, "workers": workers})


class ReprocessOptions(Options):
    """Correct the images of a list that are new or whose inputs, settings, kernels or code changed."""

    images: Annotated[NameOrFile, Cli(argument=True)] = opt(
        ..., min_length=1, description="Image list: a name of the catalog, or a CSV, TOML or Parquet file."
    )
    store: Annotated[Store, AfterValidator(lambda text: text if "://" in text else str(absolute(Path(text))))] = "out"
    profile: NameOrFile = opt(DEFAULT_PROFILE, description="Methods and settings of the steps: a name, or FILE.toml.")
    only: tuple[str, ...] = opt((), description="Only products that match this pattern (C16*); repeat for more.")
    part: Annotated[Text, AfterValidator(checked_part)] = opt(
        description="Part K of N alone, as K/N: the same images on every machine; another run does the others."
    )
    kernels: tuple[Path, ...] | None = opt(
        description="SPICE kernels for images whose list names none; repeat for more."
    )
    workers: int = opt(0, ge=0, description="Images at a time; 0: one per processor.")
    runner: str = opt(
        "threads", description="Where images are corrected: threads (this machine), dask, or dask:ADDRESS."
    )
    dry_run: bool = opt(False, description="Only print what would be done, and why.")
    force: bool = opt(False, description="Also correct unchanged images; cached steps are still used.")
    again: bool = opt(False, description="Also correct images that were refused or failed before.")
    verify: bool = opt(False, description="Compare every product with its checksums.")
    image_timeout_s: float = opt(1800.0, ge=0.1, description="Seconds that one image may take.")
    image_memory_mb: float = opt(6000.0, ge=50, description="Memory that one image may take.")
    retries: int = opt(2, ge=0, le=20, description="Number of further attempts after temporary faults.")
    retry_delay_s: float = opt(10.0, ge=0, description="Seconds before the next attempt; each time tripled.")
    most_failed_percent: float = opt(
        5.0, ge=0, le=100, description="With more failed images than this, the flow fails and the alert is raised."
    )
    fetch: bool = opt(False, description="First download the missing files of the list.")
    archive: Absolute | None = opt(description="Folder of fetched files (default: PLANETPOSE_ARCHIVE).")
    cache: Absolute | None = opt(description="Cached steps: folder (PLANETPOSE_CACHE), or s3://bucket/prefix.")
    cache_limit_gb: float | None = opt(ge=0, description="At the end, delete old cached results down to this size.")
    cache_days: float | None = opt(ge=0, description="At the end, delete results not used for so many days.")

    @property
    def folder(self) -> Path:
        """The folder that products are made in: the store, or the local one before an object store."""
        from tasks.objectstore.places import place_of

        return place_of(self.store).store

    @property
    def steps_cache(self) -> Path:
        """Folder of cached steps of this machine."""
        return self.cache if self.cache and not address_in(self.cache) else cache_folder().absolute()

    @property
    def shared_cache(self) -> str | None:
        """Address of results of steps that several machines share."""
        return (address_in(self.cache) if self.cache else None) or shared_cache_url()

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
    """Download the images, labels, kernels and maps of a list; exit status 1 if a file could not be downloaded."""

    catalog: Annotated[str, Cli(argument=True)] = opt(
        ..., description="An image list: a name of the catalog, or a file."
    )
    only: tuple[str, ...] = opt((), description="Only products that match this pattern (C16*); repeat for more.")
    what: tuple[str, ...] = opt((), description="images, labels, kernels or maps; repeat. Default: all.")
    mirror: Text = opt(description="URL or folder in place of all archives (PLANETPOSE_MIRROR).")
    dest: File = opt(description="Folder of fetched files (PLANETPOSE_ARCHIVE).")
    attempts: int = opt(4, ge=1, le=20, description="Attempts per file.")
    stall_s: float = opt(30.0, ge=0.1, description="Seconds without data after which an attempt ends.")
    requests_per_s: float = opt(4.0, ge=0.01, description="Largest number of requests per second to one host.")
    largest_mb: float = opt(2000.0, ge=0.001, description="Largest file that is fetched.")


class ExportOptions(Options):
    """Export products for other tools: backplanes, maps, catalog items, tables of pixels."""

    paths: Paths
    format: Annotated[tuple[str, ...], Cli(("--format", "-f"))] = opt(
        ...,
        min_length=1,
        description="fits, geotiff, cog, zarr-map, stac, csv, parquet, isd, isis-cube, pds4, pds4-map; repeat.",
    )
    out: Path = opt(Path("export"), description="Folder for the files.")
    projection: str = opt("equirectangular", description="Maps: equirectangular, orthographic or polar-stereographic.")
    resolution_km: Annotated[float | None, Cli(("--resolution-km", "--resolution"))] = opt(
        description="Maps: km per pixel; default: the image's."
    )
    central_longitude_deg: float | None = opt(
        description="Maps: central longitude of an equirectangular map; lower meridian of a polar map."
    )
    kernel: str = opt("bilinear", description="Maps: nearest, bilinear or cubic.")
    max_emission_deg: float | None = opt(
        ge=0, le=90, description="Maps and tables: largest emission angle; default 85 and 90."
    )
    max_incidence_deg: float = opt(90.0, ge=0, le=180, description="Tables.")
    latitude: Limits = opt(LATITUDES, description="Tables: south and north limit.")
    longitude: Limits = opt(LONGITUDES, description="Tables: west and east limit, east positive; may run through 0.")
    every_flag: bool = opt(False, description="Tables: also flagged pixels on the body.")


class ReportOptions(Options):
    """Write a store as static HTML: sortable table, distributions per camera, a page with pictures for every image."""

    store: OneStore = opt(..., description="A store.")
    out: Path = opt(Path("out/report"), description="Folder for index.html, pages and pictures.")
    picture: tuple[str, ...] = opt(
        (), description="overlay, residual, planes, limb; repeat for more. Default: the first three."
    )
    workers: int = opt(0, ge=0, description="Processes that draw; 0: one per processor.")


class KernelsOptions(KernelOptions):
    """Write corrected SPICE kernels: camera orientation, spacecraft position, target attitude, meta-kernels."""

    paths: Paths
    out: Path = opt(Path("kernels"), description="Folder for the sets; each gets a folder.")
    per_image: bool = opt(False, description="A set per image instead of one per mission.")
    check: bool = opt(True, description="Compare with plain SPICE in a second process.")


class AdjustOptions(Options):
    """Solve for errors that images share: constants of cameras, attitude and range error of sequences."""

    store: Annotated[Folder, Cli(argument=True)] = opt(
        ..., description="Store of images that the joint step corrected."
    )
    out: File = opt(description="Folder for adjust.json and a pose file per image.")
    gap: float = opt(300.0, ge=0.001, description="Longest time between two images of a sequence, seconds.")


class CheckOptions(Options):
    """Check published products: checksums, schema, values, provenance, and geometry against their own pose."""

    paths: Annotated[tuple[str, ...], Cli(argument=True)] = opt(
        ..., description="Stores, or products' folders; stores may be s3://bucket/prefix."
    )
    sample: int | None = opt(ge=1, description="Number of products of each store to check, chosen at random.")
    after: Text = opt(description="Only products after this name, to continue an interrupted check.")


def processors() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
