"""Products of stores, here or in object storage, and what is wrong with each."""

import random
from collections.abc import Iterable, Iterator
from itertools import islice
from pathlib import Path

from tasks.boundary import reason_of, trouble_of
from tasks.objectstore.location import is_url, open_object_store
from tasks.objectstore.reading import local_copy, whole_products
from tasks.publish.check import Fault, has_product_files, is_one_product, product_faults, products_in
from tasks.publish.index import product_folders


def each_checked(
    paths: Iterable[str], sample: int | None = None, after: str | None = None
) -> Iterator[tuple[str, list[Fault]]]:
    """Every product's place and faults, by name; one in an object store is copied here for as long as that takes.
    sample: so many of each path, drawn at random. after: only those whose names come after this one."""
    for path in paths:
        if not is_url(path):
            yield from ((str(folder), faults_in(folder)) for folder in chosen_folders(Path(path), sample, after))
            continue
        store = open_object_store(path)
        for product in chosen(whole_products(store), sample, after):
            with local_copy(store, product) as folder:
                yield f"{store.url}/{product}", faults_in(folder)


def chosen_folders(path: Path, sample: int | None, after: str | None) -> list[Path]:
    """The same of a product's folder, or a store; of a large store a sample looks into no more folders than it needs.
    Raises RefusedError as `products_in`."""
    if sample is None or is_one_product(path) or not path.is_dir():
        folders = {folder.name: folder for folder in products_in(path)}
        return [folders[name] for name in chosen(folders, sample, after)]
    names = [name for name in product_folders(path) if after is None or name > after]
    random.shuffle(names)
    found = list(islice((path / name for name in names if has_product_files(path / name)), sample))
    return sorted(found) if found or after is not None else products_in(path)


def chosen(names: Iterable[str], sample: int | None, after: str | None) -> list[str]:
    """Names in order: those after `after`, or `sample` of them."""
    left = sorted(name for name in names if after is None or name > after)
    return sorted(random.sample(left, sample)) if sample is not None and sample < len(left) else left


def faults_in(folder: Path) -> list[Fault]:
    """Faults of one product; one that cannot be looked at has that as its fault."""
    faults: list[Fault] = []
    error = trouble_of(lambda: faults.extend(product_faults(folder)), folder.name)
    return faults if error is None else [Fault("file", f"the product cannot be checked: {reason_of(error)}")]
