"""What has to be done for an image, and why."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from catalog.absent import standing_in
from catalog.errors import PlanetposeError, RefusedError
from catalog.input_file import digest_of
from catalog.spice import KernelLists
from flows.chain import Chain, NotCachedError
from flows.options import ReprocessOptions
from flows.reprocessing.outcomes import Outcome, read_outcome, read_trace
from flows.request import Request
from flows.trace import changes, known_chain, trace_of
from tasks.boundary import PUBLISHED
from tasks.fields import Json
from tasks.objectstore.publishing import origin_at, product_fault_at
from tasks.publish.checksums import CHECKSUMS, checksum_faults, read_checksums
from tasks.publish.origin import OTHER_IMAGE, refuse_other_image
from tasks.record import read_record
from tasks.registry import PUBLISH

IMAGE_MISSING = "image-missing"
SHOWN = 4
TRIES = 3  # runs that take up an image that hung, or whose process died, while nothing about it changes


@dataclass(frozen=True)
class Plan:
    """do: whether the image is to be done. why: the reason, for people. image: digest of the image's file, or its fault
    when it cannot be read. changed: whether it is another reason than a fault that may pass. trace: of its steps, as
    far as they are known now. last: what is remembered of it."""

    request: Request
    do: bool
    why: str
    image: str
    changed: bool = True
    trace: Json = field(default_factory=dict)
    last: Outcome | None = None


def plan_of(request: Request, options: ReprocessOptions, kernels: KernelLists | None = None) -> Plan:
    """Whether to do an image, and why: by the keys of its steps, as `correct` has them."""
    last = read_outcome(options.books, request.product, request.image_place)
    if request.addresses and request.addresses.of(request.image):
        if last is None or last.source is None:
            return Plan(request, True, "new" if last is None else "changed: its file was not had", "", last=last)
        try:
            absent = request.addresses.unchanged(request.image, last.source)
        except PlanetposeError as error:
            return Plan(request, True, f"changed: {error.reason}", "", last=last)
        if absent is None:
            return Plan(request, True, "changed: image", "", last=last)
        with standing_in(*absent):
            return plan_by_steps(request, options, kernels, last)
    return plan_by_steps(request, options, kernels, last)


def plan_by_steps(
    request: Request, options: ReprocessOptions, kernels: KernelLists | None, last: Outcome | None
) -> Plan:
    """The same, once the image is here, or known."""
    image = image_or_fault(request)
    name = reason_of_name(request, image, last)
    if last is None or name:
        return Plan(request, True, name or new_in_words(image), image, last=last)
    trace = read_trace(options.books, last)
    chain, ended_by = known_chain(request, trace, kernels or KernelLists())
    plan = Plan(request, True, "", image, trace=trace_of(chain), last=last)
    changed = reason_of_change(chain, ended_by, last, trace)
    if changed:
        return replace(plan, why=changed)
    other = other_reason(request, options, last)
    return replace(plan, do=other is not None, why=other or f"unchanged ({last.status})", changed=False)


def image_or_fault(request: Request) -> str:
    """Digest of the image's file, or `fault: ` and why it cannot be read."""
    try:
        return digest_of(request.image, "image")
    except PlanetposeError as error:
        return f"fault: {error.reason}"


def reason_of_name(request: Request, image: str, last: Outcome | None) -> str | None:
    """Why an image has to be done whose name is another one's, or was; None where there is nothing of that kind."""
    same = last is not None and last.status in PUBLISHED and last.image_sha256 == image
    same = same or (last is None and request.publish_to is not None)  # its own steps look there
    taken = None if same else taken_by_another(request, image)
    if taken is not None and (last is None or last.code != OTHER_IMAGE):
        return f"its name is taken: {taken}"
    if taken is None and last is not None and last.code == OTHER_IMAGE:
        return "its name is free now"
    return None


def reason_of_change(chain: Chain, ended_by: Exception | None, last: Outcome, trace: Json) -> str | None:
    """What changed since the image was done and its `trace` made, so that a step of it has to be done, or the end would
    be another."""
    if ended_by is None and last.status in PUBLISHED:
        product = chain.last(PUBLISH)
        return None if product and product.key == last.key else "changed: the product's key"
    if isinstance(ended_by, PlanetposeError) and ended_by.code == last.code:
        return None
    found = changes(trace, chain) if trace else ["the record of its steps (is gone)"]
    if isinstance(ended_by, NotCachedError) and not found and last.passing:
        return None
    if isinstance(ended_by, PlanetposeError):
        missing = ended_by.code == IMAGE_MISSING
        found.append("image (is gone)" if missing else ended_by.reason)
    elif not found:
        found.append(f"step {ended_by}" if isinstance(ended_by, NotCachedError) else "the verdict")
    if last.code == IMAGE_MISSING and "image" not in found:
        found.insert(0, "image (is there now)")
    return f"changed: {in_words(found)}"


def other_reason(request: Request, options: ReprocessOptions, last: Outcome) -> str | None:
    """Why an image has to be done of which nothing changed; None when it has not."""
    if options.force:
        return "forced"
    if last.status in PUBLISHED:
        if request.publish_to is not None:
            return product_fault_at(request.publish_to, request.product, last.key) if options.verify else None
        return product_fault(request.product_folder, last, options.verify)
    if last.passing and last.tries < TRIES:
        return f"{last.status} before, may pass ({last.code})"
    return f"{last.status} before ({last.code})" if options.again else None


def taken_by_another(request: Request, image: str) -> str | None:
    """The fault, when the product of the image's name is another image's; its own steps will say so."""
    try:
        origin, place = origin_at(request.publish_to, request.product_folder), request.publish_to or request.store
        refuse_other_image(origin, f"{place}/{request.product}", request.image_place, image)
    except RefusedError as error:
        return None if image.startswith("fault: ") else error.fault
    return None


def new_in_words(image: str) -> str:
    """`new`, and what its own steps will say of the image's file; `missing` where that is not there."""
    if is_missing(image):
        return "missing"
    return f"new, and will be refused: {image.removeprefix('fault: ')}" if image.startswith("fault: ") else "new"


def is_missing(image: str) -> bool:
    """Whether the image's file is not there."""
    return image.startswith(f"fault: {IMAGE_MISSING}")


def in_words(changes: list[str]) -> str:
    """A few of them on one line."""
    more = f" and {len(changes) - SHOWN} more" if len(changes) > SHOWN else ""
    return "; ".join(changes[:SHOWN]) + more


def product_fault(folder: Path, last: Outcome, verify: bool) -> str | None:
    """What is wrong with a product that is remembered as published: it is gone, another one, or has lost files.
    verify: also whether their content is what it was."""
    if not folder.is_dir():
        return "product is gone"
    if last.key is None or read_record(folder, last.key) is None:
        return "product is another one than remembered"
    faults = checksum_faults(folder) if verify else missing_files(folder)
    return f"product is damaged: {in_words(faults)}" if faults else None


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
    missing = sum(is_missing(plan.image) for plan in wanted)
    words = f"{len(wanted)} of {len(plans)} images would be done"
    return f"{words}; the files of {missing} are missing (--fetch gets those with an address)" if missing else words
