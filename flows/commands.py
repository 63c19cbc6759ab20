"""What the commands on lists and stores do: each shows a row per product or file as soon as it is known. The command
line prints the rows, the Prefect flows of the same names log them."""

from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from catalog.errors import RefusedError, WrongOptionError
from catalog.plain_text import printable
from flows.map_options import ControlOptions, ImproveMapOptions, MosaicOptions, PhotometryOptions
from flows.options import (
    AdjustOptions,
    CheckOptions,
    ExportOptions,
    FetchOptions,
    KernelsOptions,
    ReportOptions,
    processors,
)
from flows.rows import Row, Show, refuse_unknown
from flows.star_options import AstrometryOptions, StarsOptions

if TYPE_CHECKING:
    from catalog.fetch import Item


def dask_client(address: str | None) -> AbstractContextManager[Any]:
    """A client of the scheduler at this address, None of none. Raises WrongOptionError where distributed is missing."""
    if address is None:
        return nullcontext()
    try:
        from distributed import Client
    except ImportError as error:
        remedy = "Install planetpose[dask]."
        raise WrongOptionError("scheduler", f"a cluster needs the package distributed ({error}).", remedy) from error
    return cast(AbstractContextManager[Any], Client(address))


def fetch(options: FetchOptions, show: Show) -> None:
    """A row per file, then one with the counts. Raises WrongOptionError for unknown kinds, or where no product
    matches."""
    from catalog.fetch import FetchSettings
    from catalog.fetch.many import fetch_items, summary_of

    items, archive = items_of(options)
    settings = FetchSettings(
        attempts=options.attempts,
        stall_timeout_s=options.stall_s,
        requests_per_s=options.requests_per_s,
        largest_bytes=int(options.largest_mb * 1e6),
    )

    def show_file(outcome: Any) -> None:
        end = f": {outcome.reason}" if outcome.reason else ""
        text = f"{outcome.status:8s} {outcome.item.location}{end}"
        show(Row(text, outcome.to_dict(), outcome.status != "failed"))

    found = summary_of(fetch_items(items, archive, settings, show_file))
    text = (
        f"{found['files']} files: {found['fetched']} fetched ({found['bytes_fetched'] / 1e6:.1f} MB), "
        f"{found['present']} there already, {found['failed']} failed; {found['unchecked']} have no checksum to "
        f"compare with; in {archive}"
    )
    show(Row(text, {"summary": found}))


def items_of(options: FetchOptions) -> "tuple[list[Item], Path]":
    """What is fetched, and the folder that it comes into. Raises WrongOptionError as `fetch`."""
    from catalog.fetch import planned_items
    from catalog.fetch.plan import KINDS
    from catalog.fetch.settings import default_mirror
    from catalog.lists import load_image_list
    from catalog.settings import archive_folder

    refuse_unknown("what", options.what, KINDS)
    image_list = load_image_list(options.catalog)
    wanted = image_list.only(options.only) if options.only else image_list
    if not wanted.entries:
        raise WrongOptionError("only", f"no product of {options.catalog} matches.", "See `planetpose catalog show`.")
    items = planned_items(wanted, options.mirror or default_mirror(), options.what or KINDS)
    return items, options.dest or archive_folder()


def export(options: ExportOptions, show: Show) -> None:
    """A row per product. Raises WrongOptionError for an unknown format, projection or kernel."""
    from tasks.export.pixels import Selection
    from tasks.export.products import Exported, export_products
    from tasks.export.settings import ExportSettings
    from tasks.publish.check import products_in

    emission = {} if options.max_emission_deg is None else {"max_emission_deg": options.max_emission_deg}
    limits = options.max_incidence_deg, emission.get("max_emission_deg", Selection.max_emission_deg)
    selection = Selection(options.latitude, options.longitude, *limits, every_flag=options.every_flag)
    formats, middle_deg = tuple(dict.fromkeys(options.format)), options.central_longitude_deg
    try:
        settings = ExportSettings(
            formats,
            options.projection,
            options.resolution_km,
            middle_deg,
            options.kernel,
            selection=selection,
            **emission,
        )
    except RefusedError as error:
        raise WrongOptionError(error.code.removesuffix("-unknown"), error.fault, error.remedy) from error

    def show_product(result: Exported) -> None:
        lines = [str(path) for path in result.files.values()]
        lines += [f"{result.product}: {result.reason}"] if result.reason else []
        show(Row("\n".join(lines), result.to_dict(), not result.reason))

    products = (folder for path in options.paths for folder in products_in(path))
    export_products(products, settings, options.out, show_product)


def report(options: ReportOptions, show: Show) -> None:
    """A row with the page's path; asides for what could not be drawn or read. Raises WrongOptionError for an unknown
    picture."""
    from tasks.report.pictures import KINDS, USUAL
    from tasks.report.write import write_report

    refuse_unknown("picture", options.picture, KINDS)
    progress = lambda product: show(Row(f"  {product}", minor=True, aside=True))  # noqa: E731 - one line
    workers = options.workers or processors()
    written = write_report(options.store, options.out, options.picture or USUAL, progress, workers)
    for name, why in written.missing.items():
        show(Row(f"{name}: not drawn: {why}", good=False, aside=True))
    for name, why in written.broken.items():
        show(Row(f"{name}: {why}", good=False, aside=True))
    show(Row(str(written.page), {"page": str(written.page), "images": written.images}))


def kernels(options: KernelsOptions, show: Show) -> None:
    """A row per set of kernels; asides for products that were left out."""
    from catalog.settings import default_kernels
    from tasks.kernels.store import kernels_of

    given = options.chosen_kernels

    def refused(product: Path, reason: str) -> None:
        show(Row(f"{printable(product.name)}: left out: {reason}", good=False, aside=True))

    mission = default_kernels() if given is None else list(given)
    for found in kernels_of(options.paths, options.out, mission, options.per_image, options.check, refused):
        lines = []
        for kind, path in found["meta_kernels"].items():
            trip = (found["round_trip_deg"] or {}).get(kind)
            agrees = f"; plain SPICE agrees to {max(trip.values()):.1e} deg" if trip else ""
            lines.append(f"{path}: {len(found['products'])} images, {kind}{agrees}")
        lines += [f"  {note['product']}: no {note['what']}: {note['why']}" for note in found["left_out"]]
        show(Row("\n".join(lines), found))


def photometry(options: PhotometryOptions, show: Show) -> None:
    """A row per region, then the files; asides for products that were left out. Raises WrongOptionError for an unknown
    law, or a held value that is none."""
    from tasks.export.pixels import Selection
    from tasks.photometry.files import in_json, write_photometry
    from tasks.photometry.fit import FitSettings
    from tasks.photometry.laws import LAWS
    from tasks.photometry.regions import PhotometrySettings, bound_values, held_values, prior_values, read_regions
    from tasks.photometry.store import fit_store

    refuse_unknown("law", (options.law,), tuple(LAWS))
    selection = Selection(options.latitude, options.longitude, options.max_incidence_deg, options.max_emission_deg)
    calibration, held = options.calibration_percent / 100, held_values(options.hold)
    priors, bounds = prior_values(options.prior), bound_values(options.bound)
    fit = FitSettings(calibration, options.units_per_if, held, priors, bounds, options.bootstrap)
    settings = PhotometrySettings(
        options.law, selection, options.doubtful, options.albedo_map, options.bands, options.max_pixels, fit
    )
    regions = read_regions(options.regions, selection, options.west_longitudes) if options.regions else ()
    results = fit_store(options.store, settings, regions)
    paths = write_photometry(results, options.law, options.out)
    for result in results:
        content = in_json(result, options.law)
        lines = [f"{result.name}: {content['reason'] or content['uncertainty_from']}"]
        for each in content["parameters"]:
            sigma = each["how"] if each["sigma"] is None else f"+- {each['sigma']:.3g}"
            lines.append(f"  {each['name']:20} {each['value']:.5g} {sigma} {each['unit']}".rstrip())
        show(Row("\n".join(lines), content, result.fit is not None))
    show(Row("\n".join(str(path) for path in paths)))
    for product, reason in dict(pair for result in results for pair in result.left_out).items():
        show(Row(f"{product}: left out: {reason}", good=False, aside=True))


def mosaic(options: MosaicOptions, show: Show) -> None:
    """A row with the law and levels, then the files; asides for products that were left out. Raises WrongOptionError
    for an unknown law, parameter, weight, band, format or resolution."""
    from tasks.mosaic.build import build_mosaic
    from tasks.mosaic.outputs import mosaic_summary, mosaic_text, write_forms
    from tasks.mosaic.settings import FORMATS, MosaicSettings
    from tasks.photometry.laws import LAWS
    from tasks.photometry.regions import held_values, prior_values

    refuse_unknown("law", (options.law,), tuple(LAWS))
    refuse_unknown("format", options.format, FORMATS)
    known = options.model_dump(include=set(MosaicSettings.__dataclass_fields__))
    calibration = options.calibration_percent and options.calibration_percent / 100
    held, priors = held_values(options.hold), prior_values(options.prior)
    settings = MosaicSettings(**known, calibration_sigma=calibration, held=held, priors=priors)
    with dask_client(options.scheduler):
        made = build_mosaic(options.store, options.out, settings, lambda text: show(Row(text, minor=True, aside=True)))
    show(Row(mosaic_text(made), mosaic_summary(made)))
    for path in write_forms(made, options.format):
        show(Row(str(path)))
    for product, reason in made.left_out:
        show(Row(f"{product}: left out: {reason}", good=False, aside=True))


def control(options: ControlOptions, show: Show) -> None:
    """A row with the table of images, then the files; asides for products that were left out. Raises WrongOptionError
    for an unknown law or a patch without a middle."""
    from tasks.control.files import write_control, write_control_kernels
    from tasks.control.settings import ControlSettings
    from tasks.control.store import control_report, control_store, control_table

    known = options.model_dump(include=set(ControlSettings.__dataclass_fields__))
    made = control_store(options.store, ControlSettings(**known), lambda text: show(Row(text, minor=True, aside=True)))
    report = control_report(made)
    show(Row(control_table(report), report))
    paths = write_control(made, options.out)
    paths += write_control_kernels(made, options.out / "kernels") if options.kernels else []
    show(Row("\n".join(str(path) for path in paths)))
    for product, reason in made.left_out:
        show(Row(f"{product}: left out: {reason}", good=False, aside=True))


def improve_map(options: ImproveMapOptions, show: Show) -> None:
    """A row with the table of images, then the files; asides for products that were left out. Raises WrongOptionError
    for an unknown law, frame, feature or resolution."""
    from tasks.improve.choose import improve_with
    from tasks.improve.files import improved_report, improved_table, write_improved

    made = improve_with(options.store, options.model_dump(), lambda text: show(Row(text, minor=True, aside=True)))
    report = improved_report(made)
    show(Row(improved_table(report), report))
    show(Row("\n".join(str(path) for path in write_improved(made, options.out))))
    for product, reason in made.left_out:
        show(Row(f"{product}: left out: {reason}", good=False, aside=True))


def adjust(options: AdjustOptions, show: Show) -> None:
    """One row, the report."""
    from tasks.adjust import AdjustSettings
    from tasks.adjust.measurement import NOT_JOINT
    from tasks.adjust.store import adjust_store
    from tasks.adjust.table import adjustment_table

    found = adjust_store(options.store, AdjustSettings(gap_s=options.gap), options.out)
    good = all(each["reason"].startswith(NOT_JOINT) for each in found["left_out"])
    show(Row(adjustment_table(found), found, good))


def stars(options: StarsOptions, show: Show) -> None:
    """A row per image; no stars are a result too. Raises WrongOptionError for a catalog, columns or a direction that
    are no good."""
    from tasks.stars.report import as_text
    from tasks.stars.requests import requests_of
    from tasks.stars.write import stars_of_images

    requests = requests_of(options.model_dump(), options.chosen_kernels)
    for content, good in stars_of_images(requests, options.out, options.solve):
        show(Row(as_text(content), content, good))


def astrometry(options: AstrometryOptions, show: Show) -> None:
    """A row per observation, then the files; asides for products that were left out."""
    from catalog.settings import default_kernels
    from tasks.astrometry.store import write_astrometry

    given = options.chosen_kernels
    kernels = default_kernels() if given is None else given
    rows, left_out, paths = write_astrometry(options.store, options.out, kernels, options.station)
    for row in rows:
        text = "{image}: {body} RA {ra_deg:.6f} Dec {dec_deg:.6f} deg, O-C ({oc_ra_arcsec:+.2f}, {oc_dec_arcsec:+.2f})"
        show(Row(text.format(**row) + f" arcsec, {row['stars']} stars", row))
    show(Row("\n".join(str(path) for path in paths)))
    for product, reason in left_out.items():
        show(Row(f"{product}: left out: {reason}", good=False, aside=True))


def check(options: CheckOptions, show: Show) -> None:
    """A row per product, then how many are sound."""
    from tasks.objectstore.checked import each_checked

    sound, count = 0, 0
    for folder, faults in each_checked(options.paths, options.sample, options.after):
        count, sound = count + 1, sound + (not faults)
        named = [{"kind": fault.kind, "fault": fault.text} for fault in faults]
        names = {"product": printable(Path(folder).name), "path": printable(folder)}
        text = "\n".join(f"{folder}: {fault}" for fault in faults) or f"{folder}: sound"
        show(Row(text, {**names, "sound": not faults, "faults": named}, not faults, minor=not faults))
    show(Row(f"{sound} of {count} products sound"))
