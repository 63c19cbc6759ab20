"""Cameras that are made rather than looked up: `kernels:NAME`, `isd:FILE` and `isis:CUBE`."""

from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from catalog.digest import sha256_of_file, sha256_of_json
from catalog.errors import RefusedError
from catalog.settings import default_kernels

if TYPE_CHECKING:
    from catalog.camera import Camera

KERNELS, ISD, ISIS = "kernels:", "isd:", "isis:"
PREFIXES = (KERNELS, ISD, ISIS)
MADE_REMEDY = "Give kernels:NAME (a NAIF instrument name or id, with --kernels), isd:FILE.json or isis:FILE.cub."


def is_made(name: str | None) -> bool:
    """Whether a camera's name says that it is to be made from kernels or from a file."""
    return name is not None and name.lower().startswith(PREFIXES)


def file_in(name: str) -> Path | None:
    """The file that an `isd:` or `isis:` camera is made from; None for kernels."""
    return None if name.lower().startswith(KERNELS) else Path(name.partition(":")[2])


def made_camera(name: str, kernels: Iterable[Path] | None = None) -> "Camera":
    """The camera that `kernels:NAME|ID`, `isd:FILE` or `isis:FILE` stands for. kernels: None takes the default ones.

    Raises RefusedError when kernels or file do not make one.
    """
    rest = name.partition(":")[2].strip()
    if not rest:
        raise RefusedError("camera-unknown", f"camera {name!r} names nothing to make it from.", MADE_REMEDY)
    if name.lower().startswith(KERNELS):
        from catalog.kernel_camera import camera_from_kernels

        used = default_kernels() if kernels is None else list(kernels)
        return camera_from_kernels(used, rest)
    if name.lower().startswith(ISD):
        from catalog.isd import camera_from_isd

        return camera_from_isd(Path(rest))
    from catalog.isis_tables import camera_from_cube

    return camera_from_cube(Path(rest))


def camera_as_file(name: str, kernels: Iterable[Path], folder: Path) -> Path:
    """A made camera as a TOML file in `folder`, named by its content, so that every process reads the same one."""
    paths = tuple(kernels)
    source = file_in(name)
    return _written(name, paths, folder, None if source is None else _digest(name, source))


def _digest(name: str, source: Path) -> str:
    try:
        return sha256_of_file(source)
    except OSError as error:
        raise RefusedError("camera-file-unreadable", f"camera {name}: {error}.", MADE_REMEDY) from error


@lru_cache(maxsize=16)
def _written(name: str, kernels: tuple[Path, ...], folder: Path, content: str | None) -> Path:  # noqa: ARG001
    camera = made_camera(name, kernels)
    digest = sha256_of_json(camera.model_dump(mode="json", exclude_unset=True))
    path = folder / f"{camera.name}-{digest[:12]}.toml"
    if not path.exists():
        folder.mkdir(parents=True, exist_ok=True)
        temporary = path.with_name(f".{path.name}.tmp")
        temporary.write_text(camera.to_toml(), encoding="utf-8")
        temporary.replace(path)
    return path


def camera_of(
    name: str, kernels: Iterable[Path] | None, filter_name: str | None = None, temperature_c: float | None = None
) -> "Camera":
    """Any camera by name, file or prefix, under the conditions of an image. Raises RefusedError as `find_camera`."""
    from catalog.camera import find_camera

    if name.lower().startswith(KERNELS):
        from catalog.kernel_camera import camera_from_kernels

        used = default_kernels() if kernels is None else list(kernels)
        return camera_from_kernels(used, name.partition(":")[2].strip(), None, filter_name, temperature_c)
    return find_camera(name, kernels).at(filter_name, temperature_c)
