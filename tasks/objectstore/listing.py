"""Which products an object store holds, by listings alone: a request per product would be a million of them."""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from datetime import datetime
from typing import Any

from catalog.safe_name import is_safe_product_name
from tasks.objectstore.conditional import bucket_and_key, has_conditions
from tasks.objectstore.location import ObjectStore
from tasks.publish.names import CUBE
from tasks.record import RECORD_FILE

CONNECTIONS = 16
PAGE = 1000  # objects of one answer, the most that S3 gives
# What comes before and with it is listed as one, so that a cube counts as one object and not as thirty. Storage that
# knows no delimiters but `/` lists all of them, and the answer is the same after more requests.
WITHOUT_CUBES = f"/{CUBE}/"


def records_written(store: ObjectStore) -> dict[str, float]:
    """Names of the products whose record is there, and when it was written (seconds since the epoch)."""
    return listed_records(store) if has_conditions(store) else looked_up_records(store)


def listed_records(store: ObjectStore) -> dict[str, float]:
    """The same where S3 lists objects."""
    found = {}
    for key, when in keys_of(store):
        product, _, name = key.partition("/")
        if name == RECORD_FILE and is_safe_product_name(product):
            found[product] = when.timestamp()
    return dict(sorted(found.items()))


def keys_of(store: ObjectStore) -> Iterator[tuple[str, datetime]]:
    """Objects of the store but those in cubes and in hidden folders, relative to the store, with the time of each."""
    bucket, _ = bucket_and_key(store, "")
    base = store.root.partition("/")[2]
    base = f"{base}/" if base else ""
    query: dict[str, Any] = {"Bucket": bucket, "Prefix": base, "Delimiter": WITHOUT_CUBES, "MaxKeys": PAGE}
    onwards: dict[str, str] = {}
    while True:
        answer = store.files.call_s3("list_objects_v2", **query, **onwards)
        last = ""
        for each in answer.get("Contents", ()):
            last = each["Key"].removeprefix(base)
            if not last.startswith("."):
                yield last, each["LastModified"]
        if not answer.get("IsTruncated"):
            return
        # `/` is what comes after `.` in the order of listings: the rest of what is hidden is passed over.
        hidden = last.startswith(".")
        onwards = {"StartAfter": f"{base}/"} if hidden else {"ContinuationToken": answer["NextContinuationToken"]}


def sizes_below(store: ObjectStore, folder: str) -> dict[str, int]:
    """Bytes of every object in a folder of the store, by its name relative to it."""
    if not has_conditions(store):
        return _found_sizes(store, folder)
    bucket, base = bucket_and_key(store, f"{folder}/")
    query: dict[str, Any] = {"Bucket": bucket, "Prefix": base, "MaxKeys": PAGE}
    sizes: dict[str, int] = {}
    while True:
        answer = store.files.call_s3("list_objects_v2", **query)
        sizes |= {each["Key"].removeprefix(base): int(each["Size"]) for each in answer.get("Contents", ())}
        if not answer.get("IsTruncated"):
            return sizes
        query["ContinuationToken"] = answer["NextContinuationToken"]


def _found_sizes(store: ObjectStore, folder: str) -> dict[str, int]:
    place = store.path(folder)
    try:
        found = store.files.find(place, detail=True)
    except FileNotFoundError:
        return {}
    base = place.strip("/")
    return {path.strip("/").removeprefix(f"{base}/"): int(facts["size"]) for path, facts in found.items()}


def looked_up_records(store: ObjectStore) -> dict[str, float]:
    """The same with a request for each folder, of storage whose driver lists folders alone."""
    folders = [
        each["name"].rstrip("/") for each in store.files.ls(store.root, detail=True) if each["type"] == "directory"
    ]
    names = sorted(name for name in (path.rpartition("/")[2] for path in folders) if is_safe_product_name(name))
    with ThreadPoolExecutor(CONNECTIONS) as pool:
        written = list(pool.map(lambda name: _written(store, name), names))
    return {name: when for name, when in zip(names, written, strict=True) if when is not None}


def _written(store: ObjectStore, product: str) -> float | None:
    try:
        facts = store.files.info(store.path(product, RECORD_FILE))
    except FileNotFoundError:
        return None
    when = facts.get("LastModified") or facts.get("created")
    return float(when.timestamp()) if isinstance(when, datetime) else 0.0
