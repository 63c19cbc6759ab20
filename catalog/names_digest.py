"""Content hashes of the cameras and targets whose names labels may bear."""

from collections.abc import Mapping
from functools import cache

from pydantic import BaseModel

from catalog.camera import known_cameras
from catalog.digest import sha256_of_json
from catalog.target import further_targets, known_targets


@cache
def camera_names_digest() -> str:
    """Content of the catalog's camera files, and of those of plugins, whose spellings labels are compared with."""
    return _digest_of(known_cameras())


@cache
def target_names_digest() -> str:
    """Content of the catalog's target files, and of those of plugins, whose spellings labels are compared with."""
    return _digest_of(known_targets() | further_targets())


def _digest_of(known: Mapping[str, BaseModel]) -> str:
    return sha256_of_json({name: each.model_dump(mode="json", exclude_unset=True) for name, each in known.items()})
