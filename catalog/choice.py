"""Settings that name a method: one of those that come with the program, or one that a plugin adds."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import CoreSchema, core_schema

from catalog.plugins import plugins_of, refuse_unusable


@dataclass(frozen=True)
class Choice:
    """Annotation of a text that names a method: `Annotated[str, Choice("registration", group, own)]`.

    what: for messages. group: entry points that add to the names. own: names that come with the program; a plugin of
    the same name is not used. pydantic refuses other names with the list of those that are known; a plugin that cannot
    be imported is a RefusedError that says why.
    """

    what: str
    group: str
    own: tuple[str, ...] = field(default=())

    @property
    def known(self) -> tuple[str, ...]:
        """All names, those of plugins last."""
        return (*self.own, *(plugin.name for plugin in plugins_of(self.group) if plugin.name not in self.own))

    def checked(self, name: str) -> str:
        """The name. Raises ValueError listing the known ones; RefusedError for a plugin that cannot be imported."""
        if name in self.own:
            return name
        if name not in self.known:
            raise ValueError(f"there is no {self.what} {name!r}; known are {', '.join(self.known)}")
        refuse_unusable(self.group, name)
        return name

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        check: Callable[[str], str] = self.checked
        return core_schema.no_info_after_validator_function(check, handler(source))

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        return {**handler(schema), "enum": list(self.known)}
