"""Which plugins a step's result depends on, and the version of their code: part of the step's key."""

import sys
from collections.abc import Iterator, Mapping
from functools import cache
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

from pydantic import BaseModel

from catalog.choice import Choice
from catalog.digest import sha256_of_json
from catalog.plugins import plugin_named
from tasks.code_version import code_version


def plugins_in(inputs: BaseModel) -> dict[str, str]:
    """Plugins that the inputs name, `group/name`, with the versions of their code. Fields annotated with `Choice`
    count, also in models within models, sequences and mappings."""
    return {f"{group}/{name}": plugin_version(group, name) for group, name in sorted(set(_named_in(inputs)))}


def _named_in(value: Any) -> Iterator[tuple[str, str]]:
    if isinstance(value, BaseModel):
        for name, choices in _choices_of(type(value)):
            held = getattr(value, name)
            for text in _texts(held) if choices else ():
                yield from ((each.group, text) for each in choices if text not in each.own)
            yield from _named_in(held)
    elif isinstance(value, Mapping):
        for each in value.values():
            yield from _named_in(each)
    elif isinstance(value, tuple | list):
        for each in value:
            yield from _named_in(each)


@cache
def _choices_of(model: type[BaseModel]) -> tuple[tuple[str, tuple[Choice, ...]], ...]:
    """The fields of a model that can name a method or hold what does, with the choices of each."""
    fields = []
    for name, info in model.model_fields.items():
        choices = (*(each for each in info.metadata if isinstance(each, Choice)), *_choices_in(info.annotation))
        if choices or info.annotation not in (str, int, float, bool):
            fields.append((name, choices))
    return tuple(fields)


def _choices_in(annotation: Any) -> list[Choice]:
    """Choices anywhere in an annotation, such as `tuple[Annotated[str, Choice(...)], ...] | None`."""
    origin, parts = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        return [each for each in parts[1:] if isinstance(each, Choice)]
    if origin in (tuple, list, Union, UnionType):
        return [choice for part in parts for choice in _choices_in(part)]
    return []


def _texts(value: Any) -> Iterator[str]:
    if isinstance(value, str):
        yield value
    elif isinstance(value, tuple | list):
        for each in value:
            yield from _texts(each)


@cache
def plugin_version(group: str, name: str) -> str:
    """Sixteen hex digits for a plugin: its distribution with its version, and all modules of its package that the one
    which the entry point names imports; where they are no Python source the distribution's version stands alone.

    Raises RefusedError when it cannot be imported, LookupError when there is none of this name.
    """
    plugin = plugin_named(group, name)
    if plugin is None:
        raise LookupError(f"there is no plugin {name!r} in {group}")
    plugin.load()
    return sha256_of_json({"distribution": plugin.distribution, "code": _source_version(plugin.entry.module)})[:16]


def _source_version(module: str) -> str | None:
    if not getattr(sys.modules.get(module.partition(".")[0]), "__file__", None):
        return None  # a namespace package
    try:
        return code_version(module)
    except LookupError:
        return None  # compiled
