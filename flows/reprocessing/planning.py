"""What has to be done for an image, and why."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from catalog.errors import RefusedError
from flows.reprocessing.fingerprint import Fingerprint, differences, fingerprint_of, in_words
from flows.reprocessing.outcomes import Outcome, read_outcome
from flows.reprocessing.settings import Settings
from flows.request import Request
from flows.verdict import PUBLISHED
from tasks.publish.checksums import CHECKSUMS, checksum_faults, read_checksums
from tasks.publish.origin import OTHER_IMAGE, origin_of, refuse_other_image
from tasks.record import read_record


@dataclass(frozen=True)
class Plan:
    """do: whether the image is to be done. why: the reason, for people. fingerprint: of all that it depends on now.
    last: what is remembered of it."""

    request: Request
    do: bool
    why: str
    fingerprint: Fingerprint
    last: Outcome | None = None


def plan_of(request: Request, settings: Settings) -> Plan:
    """Whether to do an image, and why."""
    last = read_outcome(settings.books, request.product, request.image)
    fingerprint = fingerprint_of(request)
    reason = reason_to_do(request, settings, fingerprint, last)
    why = reason or f"unchanged ({last.status})" if last else reason or "new"
    return Plan(request, reason is not None, why, fingerprint, last)


def reason_to_do(request: Request, settings: Settings, fingerprint: Fingerprint, last: Outcome | None) -> str | None:
    """Why an image has to be done; None when it has not."""
    same = last is not None and last.status in PUBLISHED and last.fingerprint.get("image") == fingerprint["image"]
    taken = None if same else taken_by_another(request, fingerprint)
    if last is None and taken is None:
        return "missing" if is_missing(fingerprint) else new_in_words(fingerprint)
    if last is None or (taken is not None and last.code != OTHER_IMAGE):
        return f"its name is taken: {taken}"
    if taken is None and last.code == OTHER_IMAGE:
        return "its name is free now"
    changes = differences(last.fingerprint, fingerprint)
    if changes:
        return f"changed: {in_words(changes)}"
    if settings.force:
        return "forced"
    if last.status in PUBLISHED:
        fault = product_fault(request.product_folder, last, settings.verify)
        return fault or (published_fault(request, last) if settings.verify else None)
    if last.passing and last.tries < settings.limits.tries:
        return f"{last.status} before, may pass ({last.code})"
    return f"{last.status} before ({last.code})" if settings.again else None


def taken_by_another(request: Request, fingerprint: Fingerprint) -> str | None:
    """The fault, when the product of the image's name is another image's; its own steps will tell it."""
    try:
        refuse_other_image(
            origin_of(request.product_folder), str(request.product_folder), request.image, str(fingerprint["image"])
        )
    except RefusedError as error:
        return None if str(fingerprint["image"]).startswith("fault: ") else error.fault
    return None


def new_in_words(fingerprint: Fingerprint) -> str:
    """`new`, and what its own steps will tell of the image's file."""
    image = str(fingerprint["image"])
    return f"new, and will be refused: {image.removeprefix('fault: ')}" if image.startswith("fault: ") else "new"


def is_missing(fingerprint: Fingerprint) -> bool:
    """Whether the image's file is not there."""
    return str(fingerprint["image"]).startswith("fault: image-missing")


def product_fault(folder: Path, last: Outcome, verify: bool) -> str | None:
    """What is wrong with a product that is remembered as published: it is gone, another one, or has lost files.
    verify: also whether their content is what it was."""
    if not folder.is_dir():
        return "product is gone"
    if last.key is None or read_record(folder, last.key) is None:
        return "product is another one than remembered"
    faults = checksum_faults(folder) if verify else missing_files(folder)
    return f"product is damaged: {in_words(faults)}" if faults else None


def published_fault(request: Request, last: Outcome) -> str | None:
    """What is wrong with the product's copy in the object store. Raises FailedError when that cannot be reached."""
    if request.publish_to is None:
        return None
    from tasks.objectstore.location import open_object_store
    from tasks.objectstore.publishing import published_key

    whole = published_key(open_object_store(request.publish_to), request.product) == last.key
    return None if whole else "product is not in the object store"


def missing_files(folder: Path) -> list[str]:
    """Files of a product that are missing or empty."""
    try:
        names = read_checksums(folder)
    except (OSError, ValueError) as error:
        return [f"{CHECKSUMS} cannot be read: {error}"]
    return [f"{name} is missing" for name in names if not has_content(folder / name)]


def has_content(path: Path) -> bool:
    """Whether a file is there and not empty."""
    try:
        return path.stat().st_size > 0
    except OSError:
        return False


def plans_in_words(plans: Sequence[Plan]) -> str:
    """How many images would be done, and of how many of them the file is not there."""
    wanted = [plan for plan in plans if plan.do]
    missing = sum(is_missing(plan.fingerprint) for plan in wanted)
    words = f"{len(wanted)} of {len(plans)} images would be done"
    return f"{words}; the files of {missing} are missing (--fetch gets those with an address)" if missing else words
