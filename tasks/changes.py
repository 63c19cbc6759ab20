"""What differs between the inputs of a step now and those of an earlier run, in words."""

from collections.abc import Mapping
from typing import Any, cast

from tasks.fields import Json
from tasks.profile.layers import differences


def inputs_changed(names: Mapping[str, str], before: Json, after: Json) -> list[str]:
    """Names of the inputs that differ, of kernels which."""
    found = []
    for path, name in names.items():
        old, new = at(before, path), at(after, path)
        if old != new:
            found += kernels_changed(old, new) if name == "kernels" else [name]
    return found


def at(content: Any, path: str) -> Any:
    """A value of nested tables by its path; None when there is none."""
    for key in path.split("."):
        content = content.get(key) if isinstance(content, dict) else None
    return content


def leaves_changed(before: Json, after: Json) -> list[str]:
    """`path old -> new` of every value that differs."""
    return [change.in_words(name) for name, change in sorted(differences(before, after).items())]


def kernels_changed(before: Any, after: Any) -> list[str]:
    """Kernels that are new, gone or have other content; their order counts too."""
    old, new = (dict(cast("list[list[str]]", kernels or [])) for kernels in (before, after))
    found = [f"kernel {name}" for name in new if name in old and old[name] != new[name]]
    found += [f"kernel {name} (new)" for name in new if name not in old]
    found += [f"kernel {name} (gone)" for name in old if name not in new]
    return found or ["kernels: their order"]
