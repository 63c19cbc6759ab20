"""The step: upload. Whether it is done is looked up in the object store, not of the cache."""

from dataclasses import asdict, dataclass
from pathlib import Path

from tasks.fields import Content
from tasks.publish.origin import origin_of, refuse_other_image
from tasks.record import Record, read_record
from tasks.step import Step, StepType
from tasks.work import Work


class UploadInputs(Content):
    """url: of the object store. publish: key of the product."""

    url: str
    product: str
    publish: str


@dataclass(frozen=True)
class UploadFiles:
    """folder: of the product."""

    folder: Path


class UploadResult(Content):
    """How much was copied, and how many objects of an older product were deleted; None where the store had it."""

    url: str
    files: int | None = None
    bytes: int | None = None
    deleted: int | None = None


def published_record(step: Step[UploadInputs, UploadFiles, UploadResult]) -> Record | None:
    """The record, if the store has the product under this key. Raises FailedError when it cannot be reached."""
    from tasks.objectstore.location import open_object_store
    from tasks.objectstore.publishing import published_key

    url = step.inputs.url
    if published_key(open_object_store(url), step.product) != step.inputs.publish:
        return None
    known = read_record(step.cached_at, step.key)
    return known or Record(step.name, step.key, step.code, step.plain_inputs, {"url": url}, 0.0, "")


def run(inputs: UploadInputs, files: UploadFiles, _: Work) -> UploadResult:
    """The product's copy in the object store (see `publish_product`).

    Raises RefusedError when the store has one of another image."""
    from tasks.objectstore.location import open_object_store
    from tasks.objectstore.publishing import publish_product, published_origin

    folder, store = files.folder, open_object_store(inputs.url)
    origin = origin_of(folder)
    if origin is not None and origin.paths:
        place = f"{store.url}/{folder.name}"
        refuse_other_image(published_origin(store, folder.name), place, origin.paths[-1], origin.sha256)
    return UploadResult(url=inputs.url, **asdict(publish_product(folder, store)))


STEP = StepType("upload", run, UploadResult, labels={"url": "object store"}, find_record=published_record)
