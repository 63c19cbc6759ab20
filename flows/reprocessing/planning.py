"""What has to be done for an image, and why."""

import os
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path

from catalog.absent import standing_in
from catalog.errors import PlanetposeError, RefusedError
from catalog.input_file import digest_of
from catalog.spice import KernelLists
from flows.chain import Chain, NotCachedError
from flows.options import ReprocessOptions
from flows.reprocessing.fingerprint import Fingerprints
from flows.request import Request
from flows.trace import changes, known_chain, trace_of
from tasks.boundary import PUBLISHED
from tasks.fields import Json
from tasks.objectstore.publishing import origin_at, product_fault_at
from tasks.outcomes import Outcome, read_outcome, read_trace
from tasks.publish.checksums import CHECKSUMS, checksum_faults, read_checksums
from tasks.publish.origin import OTHER_IMAGE, refuse_other_image
from tasks.record import read_record
from tasks.registry import PUBLISH

IMAGE_MISSING = "image-missing"
SHOWN, SHOWN_PRODUCTS = 4, 20
TRIES = 3  # runs that take up an image that hung, or whose process died, while nothing about it changes


@dataclass(frozen=True)
class Plan:
    """do: whether the image is to be done. why: the reason, for people. image: digest of the image's file, or its fault
    when it cannot be read. changed: whether it is another reason than a fault that may pass. trace: of its steps, as
    far as they are known now. last: what is remembered of it. fingerprint: of what it would be made from."""

    request: Request
    do: bool
    why: str
    image: str
    changed: bool = True
    trace: Json = field(default_factory=dict)
    last: Outcome | None = None
    fingerprint: str | None = None


def plan_of(
    request: Request,
    options: ReprocessOptions,
    kernels: KernelLists | None = None,
    fingerprints: Fingerprints | None = None,
) -> Plan:
    """Whether to do an image, and why: by the keys of its steps, as `correct` has them; where its fingerprint is that
    of its last outcome, it is unchanged without them."""
    last, kernels = read_outcome(options.books, request.product, request.image_place), kernels or KernelLists()
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
            return plan_by_steps(request, options, last, kernels)
    fingerprint = fingerprints.of(request) if fingerprints is not None else None
    same = last is not None and last.status in PUBLISHED and fingerprint == last.fingerprint is not None
    if last is not None and same and other_reason(request, options, last) is None:
        return Plan(request, False, unchanged(last), str(last.image_sha256), False, {}, last, fingerprint)
    return replace(plan_by_steps(request, options, last, kernels), fingerprint=fingerprint)


def plan_by_steps(request: Request, options: ReprocessOptions, last: Outcome | None, kernels: KernelLists) -> Plan:
    """The same by the keys of its steps."""
    image = image_or_fault(request)
    name = reason_of_name(request, image, last)
    if last is None or name:
        return Plan(request, True, name or new_in_words(image), image, last=last)
    trace = read_trace(options.books, last)
    chain, ended_by = known_chain(request, trace, kernels)
    plan = Plan(request, True, "", image, trace=trace_of(chain), last=last)
    changed = reason_of_change(chain, ended_by, last, trace)
    if changed:
        return replace(plan, why=changed)
    other = other_reason(request, options, last)
    return replace(plan, do=other is not None, why=other or unchanged(last), changed=False)


def unchanged(last: Outcome) -> str:
    """Why an image is left as it is."""
    return f"unchanged ({last.status})"


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
    return [f"{name} is missing" for name in names if not has_content(os.path.join(folder, name))]


def has_content(path: str) -> bool:
    """Whether a file is there and not empty."""
    try:
        return os.stat(path).st_size > 0
    except OSError:
        return False


class Planned:
    """What a list's plans come to: how many images there are and would be done, of how many of them the file is not
    there, why, and the first products."""

    def __init__(self) -> None:
        self.images, self.wanted, self.missing = 0, 0, 0
        self.why: Counter[str] = Counter()
        self.products: list[str] = []

    def add(self, plan: Plan) -> None:
        """Count an image."""
        self.images += 1
        if not plan.do:
            return
        self.wanted += 1
        self.missing += is_missing(plan.image)
        self.why[plan.why] += 1
        if len(self.products) < SHOWN_PRODUCTS:
            self.products.append(plan.request.product)

    def in_words(self) -> str:
        """How many images would be done, and of how many of them the file is not there."""
        words = f"{self.wanted} of {self.images} images would be done"
        remedy = f"; the files of {self.missing} are missing (--fetch gets those with an address)"
        return words + (remedy if self.missing else "")


def plans_in_words(plans: Iterable[Plan]) -> str:
    """`Planned.in_words` of plans."""
    found = Planned()
    for plan in plans:
        found.add(plan)
    return found.in_words()
