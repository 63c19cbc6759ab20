"""The version of a step's code: a hash of every module that the step's module imports from this project, however deep.

Modules count by their syntax trees without comments, docstrings, type-checking imports and the wording of errors and
log lines (see `tasks.source_code`), so that editing those redoes nothing, and editing anything else redoes every step
that reaches it. Data files (cameras, targets, maps, reseau tables) do not count: they enter a step's key by content.
"""

import hashlib
import inspect
import json
import sys
from collections.abc import Collection
from contextlib import suppress
from functools import cache
from pathlib import Path

from catalog.basemap import packaged_map_path
from catalog.errors import RefusedError
from catalog.regular_file import read_regular_text
from catalog.settings import PROJECT_ROOT, cache_folder
from tasks.atomic import file_put_in_place
from tasks.source_code import ModuleSource, read_source

PACKAGES = ("catalog", "tasks", "flows")
CODE = (".py", ".pyc")
SOURCES_FOLDER = "code"  # in the cache
KNOWN_SOURCES = f"{SOURCES_FOLDER}/sources.json"
# Some versions of some 500 modules; then those that are not of the present sources are dropped.
MOST_KNOWN = 5000


@cache
def code_version(module: str, without: Collection[str] = frozenset()) -> str:
    """Sixteen hex digits for the code of `module` and of all that it imports from this project.

    without: modules that are not followed, nor counted. Raises LookupError when there is no such module.
    """
    sources = project_sources()
    sources.count_package_of(module)
    digest = hashlib.sha256()
    for name in sorted(sources.reached_from(module, without)):
        digest.update(f"{name}\0{sources.of(name).digest}\0".encode())
    keep_known_sources()
    return digest.hexdigest()[:16]


@cache
def data_version() -> str:
    """Sixteen hex digits for the catalog's data and the packaged maps, by sizes and times of their files: other digits
    do not say that anything is another."""
    digest = hashlib.sha256()
    for top in (PROJECT_ROOT / "catalog", packaged_map_path("any").parent):
        for path in sorted(top.rglob("*")):
            if path.is_file() and path.suffix not in CODE:
                stat = path.stat()
                digest.update(f"{path}\0{stat.st_size}\0{stat.st_mtime_ns}\0".encode())
    return digest.hexdigest()[:16]


class Sources:
    """The modules of a project below `root`. known: what earlier processes found of files by the hash of their bytes;
    a file not among them is parsed."""

    def __init__(self, root: Path, known: dict[str, ModuleSource] | None = None) -> None:
        self.root = root
        self.known = known if known is not None else {}
        self.new: dict[str, ModuleSource] = {}
        self._of: dict[str, ModuleSource] = {}
        self._paths: dict[str, Path | None] = {}
        self._imports: dict[str, frozenset[str]] = {}
        self.others: dict[str, Path] = {}

    def count_package_of(self, module: str) -> None:
        """Count the top-level package of an imported module too: another distribution's step is not of this project."""
        top = module.partition(".")[0]
        file = getattr(sys.modules.get(top), "__file__", None)
        if top not in PACKAGES and file:
            path = Path(file)
            self.others[top] = path.parent.parent if path.name == "__init__.py" else path.parent

    def of(self, module: str) -> ModuleSource:
        """What is known of one module's source. Raises LookupError when there is no such module."""
        if module not in self._of:
            path = self.path_of(module)
            if path is None:
                raise LookupError(f"there is no module {module} below {self.root}")
            content = path.read_bytes()
            key = hashlib.sha256(_way_of_reading() + module.encode() + b"\0" + content).hexdigest()
            if key not in self.known:
                package = module if path.name == "__init__.py" else module.rpartition(".")[0]
                self.known[key] = self.new[key] = read_source(content, package)
            self._of[module] = self.known[key]
        return self._of[module]

    def path_of(self, module: str) -> Path | None:
        """File of a module or package; None when there is none, or it is none of this project's."""
        if module not in self._paths:
            top = module.partition(".")[0]
            root = self.root if top in PACKAGES else self.others.get(top)
            plain = root.joinpath(*module.split(".")) if root else None
            candidates = (plain / "__init__.py", plain.with_suffix(".py")) if plain else ()
            self._paths[module] = next((path for path in candidates if path.is_file()), None)
        return self._paths[module]

    def imports_of(self, module: str) -> frozenset[str]:
        """Modules of this project that one imports itself: `from a import b` is a.b where that is a module, else a."""
        if module in self._imports:
            return self._imports[module]
        found: set[str] = set()
        for name, member in self.of(module).imports:
            candidates = (f"{name}.{member}", name) if member else (name,)
            found.update(candidate for candidate in candidates[:1] if self.path_of(candidate))
            if not (member and self.path_of(candidates[0])) and self.path_of(name):
                found.add(name)
        self._imports[module] = frozenset(found)
        return self._imports[module]

    def reached_from(self, module: str, without: Collection[str] = frozenset()) -> set[str]:
        """Modules that `module` imports however deep, itself included."""
        reached: set[str] = set()
        waiting = {module}
        while waiting:
            name = waiting.pop()
            reached.add(name)
            waiting |= self.imports_of(name) - reached - set(without)
        return reached


@cache
def project_sources() -> Sources:
    """The sources of this installation, with what earlier processes found of them."""
    return Sources(PROJECT_ROOT, _read_known())


def keep_known_sources() -> None:
    """Write what was found of new sources into the cache, where that can be written: parsing all takes a second."""
    sources = project_sources()
    if not sources.new:
        return
    known = sources.known if len(sources.known) < MOST_KNOWN else sources.new
    used = {key: source.to_json() for key, source in known.items()}
    with suppress(OSError, RefusedError):
        path = cache_folder() / KNOWN_SOURCES
        path.parent.mkdir(parents=True, exist_ok=True)
        with file_put_in_place(path) as temporary:
            temporary.write_text(json.dumps(used), encoding="utf-8")
        sources.new.clear()


@cache
def _way_of_reading() -> bytes:
    """What the digest of a source depends on beside its text: how it is normalised, and by which Python."""
    reader = Path(inspect.getsourcefile(read_source) or "").read_bytes()
    return hashlib.sha256(reader + repr(sys.version_info[:2]).encode()).digest()


def _read_known() -> dict[str, ModuleSource]:
    """What earlier processes wrote; nothing where that is missing or damaged."""
    try:
        content = json.loads(read_regular_text(cache_folder() / KNOWN_SOURCES))
        return {str(key): ModuleSource.from_json(value) for key, value in content.items()}
    except (RefusedError, OSError, ValueError, TypeError, LookupError, AttributeError):
        return {}
