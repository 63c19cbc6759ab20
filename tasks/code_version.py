"""The version of a step's code is the hash of its source and of everything in this project that it imports.

Nobody has to remember to raise a number, so a changed formula can never be answered from an old result. The price:
a changed comment in a step redoes that step once.
"""

import hashlib
import re
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
ROOMS_FOLDER = "tasks"
_FROM = re.compile(r"^\s*from\s+((?:catalog|tasks)[\w.]*)\s+import\s+\(?([\w\s,]+)", re.MULTILINE)
_IMPORT = re.compile(r"^\s*import\s+((?:catalog|tasks)[\w.]*)", re.MULTILINE)


@cache
def code_version(module: str) -> str:
    """Sixteen hex digits for the source of `module` and of all it imports from this project, however deep.

    A room (`tasks/point`) counts as a whole, because its bricks are chosen by name while running; catalog modules
    count one by one, and data files (cameras, targets, maps, reseau tables) not at all: they enter a step's key by
    their content, as inputs.
    """
    digest = hashlib.sha256()
    for path in sorted(_reached_from(module)):
        digest.update(path.relative_to(ROOT).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


def _reached_from(module: str) -> set[Path]:
    """Source files that `module` reaches by imports, itself included."""
    reached: set[Path] = set()
    waiting = [module]
    while waiting:
        new = _sources(waiting.pop()) - reached
        reached |= new
        waiting += [name for path in new for name in _imports(path)]
    return reached


@cache
def _sources(module: str) -> frozenset[Path]:
    """Files that an import of `module` stands for."""
    parts = module.split(".")
    if parts[0] == ROOMS_FOLDER and len(parts) > 1 and (ROOT / ROOMS_FOLDER / parts[1]).is_dir():
        return frozenset((ROOT / ROOMS_FOLDER / parts[1]).rglob("*.py"))
    path = ROOT.joinpath(*parts)
    candidates = (path.with_suffix(".py"), path / "__init__.py")
    return frozenset(candidate for candidate in candidates if candidate.is_file())


@cache
def _imports(path: Path) -> tuple[str, ...]:
    """Names that may be modules of this project: what is imported, and for `from a import b` also `a.b`."""
    text = path.read_text(encoding="utf-8")
    names = _IMPORT.findall(text)
    for module, members in _FROM.findall(text):
        names += [module, *(f"{module}.{member}" for member in re.findall(r"\w+", members))]
    return tuple(names)
