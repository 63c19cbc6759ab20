"""The step: upload. Whether it is done is asked of the object store, not of the cache."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from tasks.objectstore.location import open_object_store
from tasks.objectstore.publishing import publish_product, published_key, published_origin
from tasks.publish.origin import origin_of, refuse_other_image
from tasks.record import Record, read_record
from tasks.step import Step
from tasks.work import Work


@dataclass(frozen=True)
class UploadStep(Step):
    """inputs: `url` of the store, `product`, `publish` (key of the product). places: `folder` of the product."""

    def record(self) -> Record | None:
        """The record, if the store has the product under this key. Raises FailedError when it cannot be reached."""
        url = self.inputs["url"]
        if published_key(open_object_store(url), self.product) != self.inputs["publish"]:
            return None
        known = read_record(self.cached_at, self.key)
        return known or Record(self.name, self.key, self.code, self.inputs, {"url": url}, 0.0, "")


def run(work: Work) -> dict[str, Any]:
    """Copy the product (see `publish_product`). Raises RefusedError when the store has one of another image."""
    folder, store = Path(work.places["folder"]), open_object_store(work.inputs["url"])
    origin = origin_of(folder)
    if origin is not None and origin.paths:
        place = f"{store.url}/{folder.name}"
        refuse_other_image(published_origin(store, folder.name), place, Path(origin.paths[-1]), origin.sha256)
    copied = publish_product(folder, store)
    return {"url": work.inputs["url"], **asdict(copied)}
