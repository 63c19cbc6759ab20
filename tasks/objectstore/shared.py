"""Results of steps that several machines share, in object storage under the keys of the steps.

A step's folder is one object, a tar file: it is there whole or not at all, one request gets or puts it, and the first
who puts it stays. It is a help and no more: where the storage is away, steps are done again.
"""

import io
import logging
import tarfile
from pathlib import Path

from catalog.errors import PlanetposeError
from tasks.atomic import folder_put_in_place
from tasks.objectstore.conditional import has_conditions, put_new, read_object
from tasks.objectstore.location import ObjectStore, open_object_store, reaching
from tasks.record import read_record
from tasks.step import AnyStep

logger = logging.getLogger("planetpose")


def obtain(url: str | None, step: AnyStep) -> bool:
    """Have a step's folder in the cache of this machine; whether it was got from the cache at `url` (None: there is
    none)."""
    if url is None or not _is_shared(step) or step.record() is not None:
        return False
    try:
        content = _content_of(open_object_store(url), step)
    except PlanetposeError as error:
        logger.warning("%s of %s: the shared cache was not read: %s", step.name, step.product, error.reason)
        return False
    return content is not None and _unpacked(content, step)


def share(url: str | None, step: AnyStep) -> None:
    """Put a finished step into the cache at `url`, where it is not there."""
    if url is None or not _is_shared(step):
        return
    try:
        store = open_object_store(url)
        with reaching(store):
            if has_conditions(store):
                put_new(store, name_of(step), packed(step.folder))
            else:
                store.files.pipe_file(store.path(name_of(step)), packed(step.folder))
    except (PlanetposeError, OSError) as error:
        logger.warning("%s of %s: the shared cache was not written: %s", step.name, step.product, error)


def name_of(step: AnyStep) -> str:
    """Name of the object of a step in the shared cache."""
    return f"{step.kind.name}/{step.key[:2]}/{step.key}.tar"


def packed(folder: Path) -> bytes:
    """The files of a folder as a tar file."""
    content = io.BytesIO()
    with tarfile.open(fileobj=content, mode="w") as archive:
        for path in sorted(folder.rglob("*")):
            if path.is_file() and not path.is_symlink():
                archive.add(path, path.relative_to(folder).as_posix())
    return content.getvalue()


def _is_shared(step: AnyStep) -> bool:
    """Not what has a place of its own: products, and what says elsewhere that it is done."""
    return step.destination is None and step.kind.find_record is None


def _content_of(store: ObjectStore, step: AnyStep) -> bytes | None:
    with reaching(store):
        return read_object(store, name_of(step))


def _unpacked(content: bytes, step: AnyStep) -> bool:
    """Whether what was got is the step's; what is not is left alone, and the step done again."""
    try:
        with folder_put_in_place(step.folder, keep=step.is_done) as folder:
            with tarfile.open(fileobj=io.BytesIO(content)) as archive:
                archive.extractall(folder, filter="data")
            if read_record(folder, step.key) is None:
                raise ValueError("no record of this key")
    except (OSError, ValueError, tarfile.TarError) as error:
        logger.warning("%s of %s: what the shared cache has is no step: %s", step.name, step.product, error)
        return False
    return True
