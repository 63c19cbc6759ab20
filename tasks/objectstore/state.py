"""What is remembered of images and runs, in the object store; each machine has a copy of what it needs.

The store's `.reprocess/` is the truth: who did an image writes it there, so that losing any machine loses nothing. A
copy in the local store is what listings and tables are made from; it is brought up to date by the objects' ETags.
"""

import json
import os
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

from tasks.atomic import file_put_in_place
from tasks.objectstore.conditional import read_object
from tasks.objectstore.location import ObjectStore, open_object_store, reaching

STATE = ".reprocess"
IMAGES, TRACES, RUNS = "images", "traces", "runs"
KEPT = (IMAGES, TRACES, RUNS)
TAGS = "tags.json"
CONNECTIONS = 16


def pull_state(url: str | None, books: Path) -> int:
    """Bring the folder `books` up to date with all that the store at `url` remembers; how many objects were read. None
    for `url`, here as below: `books` is no copy. Raises FailedError when the store cannot be reached."""
    if url is None:
        return 0
    store = open_object_store(url)
    books.mkdir(parents=True, exist_ok=True)
    tags = _read_tags(books)
    with reaching(store):
        there = {name: tag for folder in KEPT for name, tag in _listed(store, folder).items()}
        changed = [name for name, tag in there.items() if tags.get(name) != tag or not (books / name).is_file()]
        with ThreadPoolExecutor(CONNECTIONS) as pool:
            list(pool.map(lambda name: _pull(store, books, name), changed))
    for name in tags.keys() - there.keys():
        (books / name).unlink(missing_ok=True)
    with file_put_in_place(books / TAGS) as temporary:
        temporary.write_text(json.dumps(there), encoding="utf-8")
    return len(changed)


def pull_files(url: str | None, books: Path, names: list[str]) -> None:
    """Bring single files of the folder `books` up to date; one that the store lacks is deleted. Raises FailedError."""
    if url is None:
        return
    store = open_object_store(url)
    with reaching(store), ThreadPoolExecutor(CONNECTIONS) as pool:
        list(pool.map(lambda name: _pull(store, books, name), names))


def push_files(url: str | None, books: Path, names: list[str]) -> None:
    """Write files of the folder `books` into the store, in their order; one that is not here is deleted there. Raises
    FailedError."""
    if url is None:
        return
    store = open_object_store(url)
    with reaching(store):
        for name in names:
            path = books / name
            if path.is_file():
                store.files.pipe_file(store.path(STATE, name), path.read_bytes())
            else:
                with suppress(FileNotFoundError):
                    store.files.rm_file(store.path(STATE, name))


def _pull(store: ObjectStore, books: Path, name: str) -> None:
    content = read_object(store, f"{STATE}/{name}")
    if content is None:
        (books / name).unlink(missing_ok=True)
        return
    path = books / name
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.{os.getpid()}.pulled")  # thousands of files: none is flushed by itself
    temporary.write_bytes(content)
    os.replace(temporary, path)


def _listed(store: ObjectStore, folder: str) -> dict[str, str]:
    place = store.path(STATE, folder)
    try:
        found = store.files.find(place, detail=True)
    except FileNotFoundError:
        return {}
    base = store.path(STATE).strip("/")
    return {path.strip("/").removeprefix(f"{base}/"): str(facts.get("ETag")) for path, facts in found.items()}


def _read_tags(books: Path) -> dict[str, str]:
    try:
        content = json.loads((books / TAGS).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return content if isinstance(content, dict) else {}
