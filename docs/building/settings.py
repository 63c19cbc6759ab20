"""The reference of the settings, made from the models that profiles are checked against."""

import re
import typing
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from building.markdown import code, table
from catalog.choice import Choice
from tasks.profile import Profile

Model = type[BaseModel]
CODE = re.compile(r"(`[^`\n]+`)")
MARKUP = re.compile(r"([\\*_<>\[\]$|{}])")


def page(_: str = "") -> str:
    """A section for the profile and for every table in it."""
    return "\n".join(sections(Profile, (), []))


def sections(model: Model, path: tuple[str, ...], seen: list[Model]) -> list[str]:
    """A model's own section and those of the models in it; a model that comes again is not described again."""
    if model in seen:
        return []
    seen.append(model)
    heading = f"## `[{'.'.join(path)}]`" if path else "## The profile itself"
    about, meanings = text_and_meanings(" ".join((model.__doc__ or "").split()), list(model.model_fields))
    rows, inner = [], []
    for name, info in model.model_fields.items():
        if model is Profile and name == "origin":  # what a profile says of itself, not set by it
            continue
        key, nested, meaning = (
            info.alias or name,
            model_in(info.annotation),
            plain(info.description or meanings.get(name, "")),
        )
        if nested is None:
            rows.append((code(key), f"{allowed(info)}<br>{meaning}" if meaning else allowed(info), default(info)))
        else:
            inner.append(((*path, key), nested))
            if nested in seen:
                same = "as of the first pass" if is_optional(info.annotation) else "as above"
                rows.append((code(f"[{key}]"), f"table {meaning}", same))
    parts = [heading, "", plain(about) + "\n", table(("setting", "what", "default"), rows) if rows else ""]
    return ["\n".join(parts), *(part for key, nested in inner for part in sections(nested, key, seen))]


def text_and_meanings(docstring: str, fields: list[str]) -> tuple[str, dict[str, str]]:
    """A docstring's own text, and what it says of single fields: `field: text` or `one, other: text`."""
    names = "|".join(sorted((re.escape(field) for field in fields), key=len, reverse=True))
    begins = list(re.finditer(rf"(?:^|(?<=[.;] ))((?:{names})(?:, (?:{names}))*): ", docstring)) if names else []
    meanings: dict[str, str] = {}
    ends = [*(b.start() for b in begins), len(docstring)][1:]
    for begin, after in zip(begins, ends, strict=False):
        text = docstring[begin.end() : after].strip().rstrip(";")
        first, *others = begin[1].split(", ")
        meanings[first] = f"{begin[1]}: {text}" if others else text
        meanings |= dict.fromkeys(others, f"see {first}")
    return docstring[: begins[0].start()].strip() if begins else docstring, meanings


def default(info: FieldInfo) -> str:
    """The default of a setting."""
    return code(written(info.get_default()))


def allowed(info: FieldInfo) -> str:
    """Kind and limits of a setting."""
    choices = [each for each in info.metadata if isinstance(each, Choice)]
    kind = chosen(choices[0]) if choices else type_in_words(info.annotation)
    return ", ".join(part for part in (kind, limits(info)) if part)


def chosen(choice: Choice) -> str:
    """The names of a choice that come with the program."""
    return ", ".join(map(code, choice.own)) + ", or that of a [plugin](/guide/plugins.md)"


def plain(text: str) -> str:
    """A docstring's text without Markdown of its own but code."""
    parts = CODE.split(text)
    return "".join(part if i % 2 else MARKUP.sub(r"\\\1", part) for i, part in enumerate(parts))


def is_optional(annotation: Any) -> bool:
    """Whether None is allowed."""
    return NoneType in get_args(annotation)


def model_in(annotation: Any) -> Model | None:
    """The model that a field holds, or may hold; None for plain values."""
    for part in (annotation, *get_args(annotation)):
        if isinstance(part, type) and issubclass(part, BaseModel):
            return part
    return None


def type_in_words(annotation: Any) -> str:
    """A type for people: `a` or `b`, number, list of ..."""
    origin, parts = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        by_choice = next((chosen(part) for part in parts if isinstance(part, Choice)), None)
        extra = next((part.json_schema_extra for part in parts if isinstance(part, FieldInfo)), None) or {}
        return by_choice or ", ".join(code(part) for part in extra.get("enum", ())) or type_in_words(parts[0])
    if origin is Literal:
        return ", ".join(code(part) for part in parts)
    if origin in (Union, UnionType):
        return " or ".join(type_in_words(part) for part in parts if part is not NoneType) + (
            ", or none" if NoneType in parts else ""
        )
    if origin is tuple:
        return f"list of {type_in_words(parts[0])}"
    names = {float: "number", int: "whole number", bool: "true or false", str: "text"}
    return names.get(annotation) or typing.get_type_hints(annotation).__class__.__name__


def written(value: Any) -> str:
    """A default as a TOML file has it; nothing for none."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, tuple | list):
        return "[" + ", ".join(written(part) for part in value) + "]"
    return f"{value:g}" if isinstance(value, float) else str(value)


def limits(info: FieldInfo) -> str:
    """The bounds that a value is checked against."""
    signs = {"gt": ">", "ge": "≥", "lt": "<", "le": "≤", "min_length": "at least", "max_length": "at most"}
    found = []
    for bound in info.metadata:
        found += [f"{sign} {getattr(bound, name):g}" for name, sign in signs.items() if hasattr(bound, name)]
    return ", ".join(found)
