"""Get what a list names and this machine has not, before its images are planned."""

import logging

from catalog.errors import FailedError
from catalog.fetch import FetchSettings, planned_items
from catalog.fetch.settings import default_mirror
from catalog.lists import ImageList
from catalog.settings import archive_folder
from flows.fetch import fetch_items, summary_of
from flows.reprocessing.settings import Settings

logger = logging.getLogger("planetpose")


def fetch_missing(image_list: ImageList, settings: Settings) -> None:
    """Fetch images, labels, kernels and maps. What cannot be had is told in the log: its images are refused as missing,
    and come up again as soon as it is there. Raises FailedError when the archive's folder cannot be written to."""
    archive = settings.archive or archive_folder()
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
