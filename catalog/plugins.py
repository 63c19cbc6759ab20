"""What other installed distributions add: entry points of five groups, loaded when one of the group is first needed.

A plugin that cannot be used hinders nothing else: the log names it once, and where its name is used the error says
what to do.
"""

import logging
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from importlib import metadata
from importlib.metadata import EntryPoint, EntryPoints
from pathlib import Path
from types import ModuleType
from typing import Any, TypeVar

from catalog.errors import PlanetposeError, RefusedError
from catalog.reasons import Reason

READERS = "planetpose.readers"
CAMERAS = "planetpose.cameras"
TARGETS = "planetpose.targets"
REGISTRATIONS = "planetpose.registrations"
LAWS = "planetpose.laws"
GROUPS = (READERS, CAMERAS, TARGETS, REGISTRATIONS, LAWS)

T = TypeVar("T")
logger = logging.getLogger("planetpose")


@dataclass(frozen=True)
class Plugin:
    """One entry point of another distribution."""

    entry: EntryPoint

    @property
    def name(self) -> str:
        """Name of the entry point."""
        return self.entry.name

    @property
    def kind(self) -> str:
        """What it adds: `reader`, `camera`, `target`, `registration` or `law`."""
        return self.entry.group.rpartition(".")[2].removesuffix("s")

    @property
    def distribution(self) -> str:
        """Name and version of the distribution that it belongs to, `NAME VERSION`; its module where that is unknown."""
        dist = self.entry.dist
        return f"{dist.name} {dist.version}" if dist is not None else self.entry.module

    def __str__(self) -> str:
        return f"{self.kind} {self.name!r} of {self.distribution} ({self.entry.value})"

    def load(self) -> Any:
        """The object that the entry point names. Raises RefusedError when it cannot be imported."""
        with self.guarded("cannot be imported"):
            return self.entry.load()

    @contextmanager
    def guarded(self, doing: str) -> Iterator[None]:
        """Whatever goes wrong inside becomes a RefusedError that names the plugin; doing: `cannot be imported` ..."""
        try:
            yield
        except PlanetposeError:
            raise
        except Exception as error:  # another distribution's code may raise anything
            raise self.fault(f"{doing} ({type(error).__name__}: {error})") from error

    def fault(self, doing: str) -> RefusedError:
        """The refusal that names the plugin. doing: what it does wrong."""
        name = self.entry.dist.name if self.entry.dist is not None else self.entry.module
        remedy = f"Install {name} again with what it needs, tell its authors, or do without: pip uninstall {name}."
        return RefusedError(Reason.PLUGIN_UNUSABLE, f"the plugin {self} {doing}.", remedy)


@cache
def _installed() -> Any:
    """All entry points: what is installed is looked through once, not for every group."""
    return metadata.entry_points()


def entry_points(group: str) -> EntryPoints:
    """Entry points of a group."""
    return _installed().select(group=group)


@cache
def plugins_of(group: str) -> tuple[Plugin, ...]:
    """Plugins of one of GROUPS by name; of two with the same name the one of the first distribution, by its name."""
    found: dict[str, Plugin] = {}
    for plugin in sorted(map(Plugin, entry_points(group=group)), key=lambda each: (each.name, each.distribution)):
        if plugin.name in found:
            logger.warning("planetpose: %s is not used: the name is that of %s.", plugin, found[plugin.name])
        else:
            found[plugin.name] = plugin
    return tuple(found.values())


@cache
def plugin_named(group: str, name: str) -> Plugin | None:
    """The plugin of this name; None when there is none."""
    return next((plugin for plugin in plugins_of(group) if plugin.name == name), None)


def contributed(
    group: str, made_of: Callable[[Plugin], Iterable[tuple[str, T]]], taken: Collection[str]
) -> dict[str, T]:
    """What all usable plugins of `group` give by its name; names that are `taken` stay with their owner.

    made_of: names and things of one plugin; what it raises is logged, and nothing else is lost.
    """
    found: dict[str, T] = {}
    for plugin in plugins_of(group):
        try:
            with plugin.guarded("cannot be used"):
                given = list(made_of(plugin))
        except PlanetposeError as error:
            logger.warning("planetpose: %s", error.reason)
            continue
        for name, thing in given:
            if name in taken or name in found:
                logger.warning("planetpose: the %s %r of %s is not used: the name is taken.", plugin.kind, name, plugin)
            else:
                found[name] = thing
    return found


def refuse_unusable(group: str, name: str) -> None:
    """Raise the RefusedError of a plugin of this name that cannot be imported; nothing where there is none."""
    plugin = plugin_named(group, name)
    if plugin is not None:
        plugin.load()


def toml_given(plugin: Plugin) -> list[Path | dict[str, Any]]:
    """What a camera or target plugin gives: TOML files, or their content.

    The entry point names the path of a file or of a folder of files, a dict of the content, a sequence of these, a
    function without arguments that returns one of these, or a module or package: then the TOML files in its folder.
    Raises RefusedError for anything else, and where there is no file.
    """
    given = plugin.load()
    if callable(given):
        given = given()
    found = list(_flat(given))
    if not found:
        raise plugin.fault("gives no TOML file")
    for each in found:
        if not isinstance(each, Path | dict):
            raise plugin.fault(f"gives {type(each).__name__} instead of the path of a TOML file or its content")
    return found


def _flat(given: Any) -> Iterator[Any]:
    if isinstance(given, ModuleType):
        folders = list(getattr(given, "__path__", ())) or [str(Path(str(given.__file__)).parent)]
        for folder in folders:
            yield from sorted(Path(folder).glob("*.toml"))
    elif isinstance(given, str):
        yield from _flat(Path(given))
    elif isinstance(given, Path):
        yield from sorted(given.glob("*.toml")) if given.is_dir() else [given]
    elif isinstance(given, list | tuple):
        for each in given:
            yield from _flat(each)
    else:
        yield given
