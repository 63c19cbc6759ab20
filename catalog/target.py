"""A target is one TOML file: triaxial radii, IAU rotation model, base map."""

from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from catalog.body import RotationModel, Target
from catalog.errors import RefusedError
from catalog.pck import target_from_pck
from catalog.plain_files import read_toml_file
from catalog.plugins import TARGETS, Plugin, contributed, toml_given
from catalog.reasons import Reason
from catalog.regular_file import is_regular

__all__ = ["RotationModel", "Target"]

TARGET_FOLDER = Path(__file__).parent / "targets"
MORE_TARGETS = Path(__file__).parent / "more_targets.toml"
TARGET_REMEDY = "docs/guide/add-target.md has an example; or give the name of one that `planetpose targets` lists."


@cache
def known_targets() -> dict[str, Target]:
    """All targets of the catalog by lower-case name, then those that plugins add."""
    targets = (read_target_file(path) for path in sorted(TARGET_FOLDER.glob("*.toml")))
    own = {target.name.lower(): target for target in targets}
    return own | contributed(TARGETS, _targets_of, own)


@cache
def further_targets() -> dict[str, Target]:
    """Moons and small bodies without a base map, by lower-case name: those of `more_targets.toml` that are not in
    `known_targets`."""
    content = read_toml_file(MORE_TARGETS)["target"]
    targets = (target_from_dict(each, f"{MORE_TARGETS.name}, {each.get('name')}") for each in content)
    return {target.name: target for target in targets if target.name not in known_targets()}


def _targets_of(plugin: Plugin) -> list[tuple[str, Target]]:
    """Targets of a plugin by their names in lower case."""
    given = [
        target_from_dict(each, f"of {plugin.distribution}") if isinstance(each, dict) else read_target_file(each)
        for each in toml_given(plugin)
    ]
    return [(target.name.lower(), target) for target in given]


def is_target_file(name_or_file: str) -> bool:
    """Whether the user's target is a file rather than a name."""
    return name_or_file.lower().endswith(".toml")


def target_from_dict(content: dict[str, Any], origin: str) -> Target:
    """Target of a TOML file's content. Raises RefusedError naming `origin` and each bad field."""
    try:
        return Target.model_validate(content)
    except ValidationError as error:
        faults = "; ".join(f"{'.'.join(map(str, e['loc'])) or 'target'}: {e['msg']}" for e in error.errors())
        raise RefusedError(Reason.TARGET_FILE_INVALID, f"target file {origin}: {faults}.", TARGET_REMEDY) from error


def read_target_file(path: Path) -> Target:
    """Target of a TOML file; its shape model and its map may lie beside it.

    Raises RefusedError naming the file and each fault.
    """
    try:
        content = read_toml_file(path)
    except (OSError, ValueError) as error:
        fault = f"target file {path} cannot be read: {error}."
        raise RefusedError(Reason.TARGET_FILE_UNREADABLE, fault, TARGET_REMEDY) from error
    target = target_from_dict(content, str(path))
    if target.basemap and is_regular(path.parent / target.basemap):
        target = target.model_copy(update={"basemap": str((path.parent / target.basemap).absolute())})
    return target if target.shape is None else target.with_shape(path.parent / target.shape)


def target_names() -> dict[str, str]:
    """Every accepted lower-case spelling, with the catalog name it stands for."""
    every = known_targets() | further_targets()
    names = {key: key for key in every}
    for key, target in every.items():
        for alias in target.aliases:
            names.setdefault(alias.lower(), key)  # a plugin's alias takes nothing from the catalog's own
    return names


def known_target(name: str) -> Target | None:
    """The catalog's target of a name or alias, also of a plugin; None where it has none."""
    key = target_names().get(name.strip().lower())
    return (known_targets() | further_targets())[key] if key is not None else None


def find_target(name: str, kernels: Iterable[Path] = ()) -> Target:
    """Target by catalog name or alias, or of a user's TOML file (FILE.toml), else any body that a PCK among `kernels`
    gives radii for.

    Raises RefusedError listing what is known, or what is wrong with the file.
    """
    if is_target_file(name):
        return read_target_file(Path(name))
    known = known_target(name)
    if known is not None:
        return known
    return target_from_pck(name.strip(), kernels, tuple(target_names()), tuple(known_targets()))
