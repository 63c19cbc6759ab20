"""Copy the index of a mirror into its object store: the parts that changed since the last copy, and no others."""

import json
from contextlib import suppress
from pathlib import Path

from catalog.plain_files import own_json
from catalog.safe_name import INDEX
from tasks.atomic import file_put_in_place
from tasks.objectstore.location import ObjectStore, reaching
from tasks.publish.index_parts import part_paths

COPIED = ".index-copied.json"  # in the mirror: size and time of each part when it was copied


def upload_index(mirror: Path, store: ObjectStore) -> int:
    """Bring `index.parquet` of the store up to date, one object or several below that name; returns how many were
    written. What is no part any more is deleted last, so that a reader does not find less than before; but one object
    goes before the several that follow it, for some storage has no room for both under one name. Raises FailedError
    when the storage cannot be reached."""
    paths = {path.relative_to(mirror).as_posix(): path for path in part_paths(mirror)}
    if not paths:
        return 0
    stamps = {name: [path.stat().st_size, path.stat().st_mtime_ns] for name, path in paths.items()}
    known = _copied(mirror)
    with reaching(store):
        there = _objects(store)
        changed = [name for name in paths if known.get(name) != stamps[name] or name not in there]
        if INDEX in there and INDEX not in paths:
            store.files.rm_file(store.path(INDEX))
        for name in changed:
            store.files.put_file(str(paths[name]), store.path(name))
        for name in sorted(there - paths.keys() - {INDEX}):
            with suppress(FileNotFoundError):  # another one deleted it
                store.files.rm_file(store.path(name))
    with file_put_in_place(mirror / COPIED) as temporary:
        temporary.write_text(json.dumps(stamps), encoding="utf-8")
    return len(changed)


def _objects(store: ObjectStore) -> set[str]:
    """Names of the objects that the store's index consists of."""
    base = store.root.strip("/")
    try:
        found = store.files.find(store.path(INDEX))
    except FileNotFoundError:
        return set()
    return {path.strip("/").removeprefix(f"{base}/") for path in found}


def _copied(mirror: Path) -> dict[str, list[int]]:
    try:
        content = own_json((mirror / COPIED).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return content if isinstance(content, dict) else {}
