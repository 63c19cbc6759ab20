"""A profile file over the profile that it builds on: which settings it takes over, and which it changes."""

from collections.abc import Mapping
from types import NoneType
from typing import Any, get_args

from pydantic import BaseModel, ConfigDict

Content = dict[str, Any]
# What a TOML file writes for None, which TOML has no word for.
NONE = "none"
# Settings of a later pass are those of the first pass but for what they change.
LATER, STEPS = "later", "steps"


class Change(BaseModel):
    """One setting that differs: its value in the base, and here."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    base: Any
    here: Any

    def in_words(self, name: str) -> str:
        """`name old -> new`."""
        return f"{name} {_written(self.base)} -> {_written(self.here)}"


class Origin(BaseModel):
    """What a user's profile builds on. bases: the profiles below it, names or files, the nearest first; the last one
    came with the program. changes: the settings, by dotted name, that differ from the last one's."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    bases: tuple[str, ...]
    changes: dict[str, Change]


def merged(base: Content, over: Content) -> Content:
    """`over` on top of `base`: tables merge, everything else (lists, too) replaces."""
    both = {
        key: merged(base[key], value) if isinstance(value, dict) and isinstance(base.get(key), dict) else value
        for key, value in over.items()
    }
    return base | both


def with_later_completed(content: Content) -> Content:
    """Each step's table under `later` on top of that of the first pass."""
    later = content.get(LATER)
    if not isinstance(later, dict):
        return content
    complete = {
        step: merged(content.get(step, {}), table) if step != STEPS and isinstance(table, dict) else table
        for step, table in later.items()
    }
    return content | {LATER: complete}


def with_nothing(model: type[BaseModel], content: Content) -> Content:
    """The text `none` of settings that may be none, and have no text of their own that says so, as None."""
    fields = {info.alias or name: info for name, info in model.model_fields.items()}
    return {key: _nothing(fields[key].annotation, value) if key in fields else value for key, value in content.items()}


def _nothing(annotation: Any, value: Any) -> Any:
    parts = (annotation, *get_args(annotation))
    if isinstance(value, dict):
        models = [part for part in parts if isinstance(part, type) and issubclass(part, BaseModel)]
        return with_nothing(models[0], value) if models else value
    words = {word for part in parts for word in get_args(part)} | set(get_args(annotation))
    return None if value == NONE and NoneType in parts and str not in parts and NONE not in words else value


def differences(base: Mapping[str, Any], here: Mapping[str, Any], path: tuple[str, ...] = ()) -> dict[str, Change]:
    """Settings, by dotted name, that two resolved profiles have different values of."""
    found: dict[str, Change] = {}
    for key in (*base, *(key for key in here if key not in base)):
        old, new = base.get(key), here.get(key)
        if isinstance(old, Mapping) and isinstance(new, Mapping):
            found |= differences(old, new, (*path, key))
        elif old != new:
            found[".".join((*path, key))] = Change(base=old, here=new)
    return found


def in_words(name: str, origin: Origin) -> str:
    """One sentence for the user."""
    below = ", which builds on ".join(origin.bases)
    changes = "; ".join(change.in_words(key) for key, change in origin.changes.items()) or "nothing"
    return f"profile {name} builds on {below}; of {origin.bases[-1]} it changes {changes}."


def _written(value: Any) -> str:
    return NONE if value is None else str(value)
