"""Products of stores, here or in object storage, and what is wrong with each."""

from collections.abc import Iterable, Iterator
from pathlib import Path

from tasks.boundary import reason_of, trouble_of
from tasks.objectstore.location import is_url, open_object_store
from tasks.objectstore.reading import local_copy, whole_products
from tasks.publish.check import Fault, product_faults, products_in


def each_checked(paths: Iterable[str]) -> Iterator[tuple[str, list[Fault]]]:
    """Every product's place and faults; one in an object store is copied here for as long as that takes."""
    for path in paths:
        if not is_url(path):
            yield from ((str(folder), faults_in(folder)) for folder in products_in(Path(path)))
            continue
        store = open_object_store(path)
        for product in whole_products(store):
            with local_copy(store, product) as folder:
                yield f"{store.url}/{product}", faults_in(folder)


def faults_in(folder: Path) -> list[Fault]:
    """Faults of one product; one that cannot be looked at has that as its fault."""
    faults: list[Fault] = []
    error = trouble_of(lambda: faults.extend(product_faults(folder)), folder.name)
    return faults if error is None else [Fault("file", f"the product cannot be checked: {reason_of(error)}")]
