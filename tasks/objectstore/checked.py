"""Products of stores, here or in object storage, and what is wrong with each."""

import random
from collections.abc import Iterable, Iterator
from pathlib import Path

from tasks.boundary import reason_of, trouble_of
from tasks.objectstore.location import is_url, open_object_store
from tasks.objectstore.reading import local_copy, whole_products
from tasks.publish.check import Fault, product_faults, products_in


def each_checked(
    paths: Iterable[str], sample: int | None = None, after: str | None = None
) -> Iterator[tuple[str, list[Fault]]]:
    """Every product's place and faults, by name; one in an object store is copied here for as long as that takes.
    sample: so many of each path, drawn at random. after: only those whose names come after this one."""
    for path in paths:
        if not is_url(path):
            folders = {folder.name: folder for folder in products_in(Path(path))}
            yield from ((str(folders[name]), faults_in(folders[name])) for name in chosen(folders, sample, after))
            continue
        store = open_object_store(path)
        for product in chosen(whole_products(store), sample, after):
            with local_copy(store, product) as folder:
                yield f"{store.url}/{product}", faults_in(folder)


def chosen(names: Iterable[str], sample: int | None, after: str | None) -> list[str]:
    """Names in order: those after `after`, or `sample` of them."""
    left = sorted(name for name in names if after is None or name > after)
    return sorted(random.sample(left, sample)) if sample is not None and sample < len(left) else left


def faults_in(folder: Path) -> list[Fault]:
    """Faults of one product; one that cannot be looked at has that as its fault."""
    faults: list[Fault] = []
    error = trouble_of(lambda: faults.extend(product_faults(folder)), folder.name)
    return faults if error is None else [Fault("file", f"the product cannot be checked: {reason_of(error)}")]
