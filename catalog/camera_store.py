"""Made cameras as files, and any camera under the conditions of an image."""

import os
from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path

from catalog.camera import Camera, camera_from_dict, find_camera
from catalog.digest import sha256_of_file, sha256_of_json
from catalog.errors import RefusedError
from catalog.made_camera import KERNELS, MADE_REMEDY, file_in, made_content
from catalog.reasons import Reason


def camera_as_file(name: str, kernels: Iterable[Path], folder: Path) -> Path:
    """A made camera as a TOML file in `folder`, named by its content, so that every process reads the same one."""
    paths = tuple(kernels)
    source = file_in(name)
    return _written(name, paths, folder, None if source is None else _digest(name, source))


def _digest(name: str, source: Path) -> str:
    try:
        return sha256_of_file(source)
    except OSError as error:
        raise RefusedError(Reason.CAMERA_FILE_UNREADABLE, f"camera {name}: {error}.", MADE_REMEDY) from error


@lru_cache(maxsize=16)
def _written(name: str, kernels: tuple[Path, ...], folder: Path, content: str | None) -> Path:  # noqa: ARG001
    camera = find_camera(name, kernels)
    digest = sha256_of_json(camera.model_dump(mode="json", exclude_unset=True))
    path = folder / f"{camera.name}-{digest[:12]}.toml"
    if not path.exists():
        folder.mkdir(parents=True, exist_ok=True)
        temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")  # other processes may write it, too
        temporary.write_text(camera.to_toml(), encoding="utf-8")
        temporary.replace(path)
    return path


def camera_of(
    name: str, kernels: Iterable[Path] | None, filter_name: str | None = None, temperature_c: float | None = None
) -> Camera:
    """Any camera by name, file or prefix, under the conditions of an image. Raises RefusedError as `find_camera`."""
    if name.lower().startswith(KERNELS):
        return camera_from_dict(made_content(name, kernels, filter_name, temperature_c), f"of {name}")
    return find_camera(name, kernels).at(filter_name, temperature_c)


def write_camera(camera: Camera, path: Path) -> None:
    """Write a camera as a TOML file. Raises RuntimeError when that is not read as the same camera."""
    path.write_text(camera.to_toml(), encoding="utf-8")
    if find_camera(str(path)) != camera:
        raise RuntimeError(f"{path} is not read as the camera that was written")
