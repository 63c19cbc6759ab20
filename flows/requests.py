"""The requests of a command: of files, or of an image list; and the fetching of what a list names before."""

import logging
from collections.abc import Iterator
from pathlib import Path

from pydantic import ValidationError

from catalog.basemap import NO_MAP
from catalog.errors import FailedError, RefusedError, WrongOptionError
from catalog.fetch import FetchSettings, planned_items
from catalog.fetch.addresses import Addresses, with_addresses
from catalog.fetch.many import fetch_items, summary_of
from catalog.fetch.remote import have_shared
from catalog.fetch.settings import default_mirror
from catalog.lists import load_image_list
from catalog.lists.location import address_in, parse_location
from catalog.lists.model import ImageEntry, ImageList
from catalog.made_camera import file_in, is_made
from catalog.pose import IN_IMAGE
from catalog.safe_name import is_safe_product_name, safe_product_name
from catalog.settings import archive_folder
from catalog.stars.files import check_catalog
from catalog.target import is_target_file
from flows.guided import guided
from flows.image_options import ImageOptions
from flows.options import CorrectOptions, ReprocessOptions
from flows.request import Request
from tasks.objectstore.places import place_of, usable_place_of
from tasks.profile import Profile, find_profile

logger = logging.getLogger("planetpose")


def requests_of_files(options: CorrectOptions) -> list[Request]:
    """One request per file, in their order. Raises RefusedError that names the option when the options are no good: for
    an unknown profile, one with nothing left to correct, or products that are too few or no names of folders."""
    check_catalog(options.stars)
    place, names = usable_place_of(options.store), product_names(options)
    shared = {name: getattr(options, name) for name in ImageOptions.model_fields}
    shared |= {"profile": profile_of_options(options), "kernels": options.chosen_kernels}
    shared |= {"store": place.store, "publish_to": place.publish_to}
    requests = [Request(image=file, product=name, **shared) for file, name in zip(options.files, names, strict=True)]
    return [with_addresses(request, archive_folder().absolute()) for request in requests]


def product_names(options: CorrectOptions) -> list[str]:
    """Names of the files' products, those given or those of the files."""
    if not options.product:
        return [safe_product_name(file.stem) for file in options.files]
    remedy = "Give --product once for each file."
    if len(options.product) != len(options.files):
        fault = f"{len(options.product)} names for {len(options.files)} files."
        raise WrongOptionError("product", fault, remedy)
    for name in options.product:
        if not is_safe_product_name(name):
            fault = f"{name!r} is no name for a folder in a store."
            raise WrongOptionError("product", fault, f"{safe_product_name(name)!r} would be.")
    return list(options.product)


def profile_of_options(options: CorrectOptions) -> Profile:
    """The profile with what the options hold, and their number of passes."""
    profile = find_profile(options.profile)
    if options.max_passes:
        profile = profile.model_copy(update={"passes": options.max_passes})
    try:
        return profile.holding(options.hold) if options.hold else profile
    except ValidationError as error:
        faults = "; ".join(fault["msg"] for fault in error.errors())
        remedy = "Known are range, attitude, roll, offset and psf."
        raise WrongOptionError("hold", f"{', '.join(options.hold)!r}: {faults}.", remedy) from error


def requests_of_list(options: ReprocessOptions) -> list[Request]:
    """One request per image of the list, in its order. Raises RefusedError when list or profile are unknown, or no
    product matches `only`."""
    return list(each_request(listed(options), options))


def each_request(found: ImageList, options: ReprocessOptions) -> Iterator[Request]:
    """The same, made when they are wanted, of a list that was read."""
    profile = find_profile(options.profile)
    return (request_of(found, entry, options, profile) for entry in found.entries)


def listed(options: ReprocessOptions) -> ImageList:
    """The image list, or those that match `only` and are in the `part`. Raises RefusedError as `requests_of_list`."""
    found = image_list_of(options)
    if options.only:
        found = found.only(options.only)
        if not found.entries:
            raise RefusedError(
                "nothing-to-reprocess",
                f"no product of {options.images} matches {', '.join(options.only)}.",
                "See `planetpose catalog show LIST`.",
            )
    return found.part(options.part) if options.part else found


def image_list_of(options: ReprocessOptions) -> ImageList:
    """The list, also where it is at an address: then what it names by a relative path is beside it there. Raises
    FailedError when it cannot be had."""
    address = address_in(options.images)
    if address is None:
        return load_image_list(options.images)
    archive = options.archive or archive_folder().absolute()
    have_shared(address, archive)
    return load_image_list(archive / parse_location(address).path).beside(address)


def request_of(image_list: ImageList, entry: ImageEntry, options: ReprocessOptions, profile: Profile) -> Request:
    """The request for one image of a list, with the help that people gave for it."""

    def here(text: str | None) -> Path | None:
        return image_list.located(text, options.archive) if text else None

    camera = entry.camera
    if camera and camera.endswith(".toml"):
        camera = str(here(camera))
    if camera and is_made(camera) and (file := file_in(camera)):
        camera = f"{camera.partition(':')[0]}:{here(str(file))}"
    target = entry.target
    if target and is_target_file(target):
        target = str(here(target))
    place, archive = place_of(options.store), (options.archive or archive_folder()).absolute()
    texts = (entry.image, entry.label, entry.camera, entry.target, entry.pose_file, entry.basemap, *entry.kernels)
    files = {parse_location(text).path: text for text in texts if text and address_in(text)}
    found = Request(
        image=image_list.located(entry.image, options.archive),
        product=entry.product,
        store=place.store,
        publish_to=place.publish_to,
        camera=camera,
        target=target,
        pose_file=Path(IN_IMAGE) if entry.pose_file == IN_IMAGE else here(entry.pose_file),
        basemap=Path(NO_MAP) if entry.basemap == NO_MAP else here(entry.basemap),
        map_left_edge_deg=entry.map_left_edge_deg,
        flip=entry.flip,
        plane=entry.plane,
        summing=entry.summing,
        window=entry.window,
        kernels=image_list.kernel_paths(entry, options.archive) or options.kernels,
        profile=profile,
        cache=options.steps_cache,
        shared_cache=options.shared_cache,
        addresses=Addresses(archive=archive, files=files, sha256=entry.sha256) if files else None,
    )
    return guided(found)


def fetch_missing(image_list: ImageList, options: ReprocessOptions) -> None:
    """Fetch images, labels, kernels and maps. What cannot be had is named in the log: its images are refused as
    missing, and come up again as soon as it is there. Raises FailedError when the archive's folder cannot be written
    to."""
    archive = options.archive or archive_folder()
    items = planned_items(image_list, default_mirror())
    if not items:
        return
    try:
        outcomes = fetch_items(items, archive, FetchSettings(), lambda _: None)
    except OSError as error:
        raise FailedError("archive-unwritable", f"archive {archive}: {error}.", "Check the disk.") from error
    found = summary_of(outcomes)
    for location, reason in found["failures"].items():
        logger.warning("%s was not fetched: %s", location, reason)
    if found["fetched"]:
        logger.info("%s files fetched, %.1f MB", found["fetched"], found["bytes_fetched"] / 1e6)
