"""Where things are on this machine: real data, kernels, cache. Everything comes from the environment."""

import os
from pathlib import Path

from catalog.errors import RefusedError
from catalog.reasons import Reason

DEFAULT_PROFILE = "joint"  # what is taken where nobody chooses
PROJECT_ROOT = Path(__file__).resolve().parent.parent


def data_folder() -> Path | None:
    """Folder of real mission files: PLANETPOSE_DATA, else `../shared/data` beside the checkout, else None."""
    configured = os.environ.get("PLANETPOSE_DATA")
    folder = Path(configured) if configured else PROJECT_ROOT.parent / "shared" / "data"
    return folder if folder.is_dir() else None


def default_kernels() -> list[Path]:
    """Kernel files and folders to use when the user names none: PLANETPOSE_KERNELS (a path list), else data/kernels."""
    configured = os.environ.get("PLANETPOSE_KERNELS")
    if configured is not None:
        return [Path(part) for part in configured.split(os.pathsep) if part]
    folder = data_folder()
    return [folder / "kernels"] if folder and (folder / "kernels").is_dir() else []


def cache_folder() -> Path:
    """Folder of cached step results: PLANETPOSE_CACHE, else the user's cache folder (XDG)."""
    configured = os.environ.get("PLANETPOSE_CACHE")
    if configured:
        return Path(configured)
    return _own_folder("XDG_CACHE_HOME", ".cache", "PLANETPOSE_CACHE") / "planetpose"


def shared_cache_url() -> str | None:
    """Address of results of steps that several machines share: PLANETPOSE_SHARED_CACHE, else none."""
    return os.environ.get("PLANETPOSE_SHARED_CACHE") or None


def lease_s() -> float:
    """Seconds without a sign of life after which another worker takes over a product in an object store:
    PLANETPOSE_LEASE_S, else 60, about what a slow request may take with its repetitions."""
    try:
        return max(float(os.environ.get("PLANETPOSE_LEASE_S", "")), 2.0)
    except ValueError:
        return 60.0


def state_folder() -> Path:
    """Folder of what outlives a command (the local Prefect server and its database): PLANETPOSE_STATE, else XDG's."""
    configured = os.environ.get("PLANETPOSE_STATE")
    if configured:
        return Path(configured)
    return _own_folder("XDG_STATE_HOME", ".local/state", "PLANETPOSE_STATE") / "planetpose"


def archive_folder() -> Path:
    """Folder that `planetpose fetch` fills and image lists look in: PLANETPOSE_ARCHIVE, else the user's data folder."""
    configured = os.environ.get("PLANETPOSE_ARCHIVE")
    if configured:
        return Path(configured)
    return _own_folder("XDG_DATA_HOME", ".local/share", "PLANETPOSE_ARCHIVE") / "planetpose" / "archive"


def ways_out_of(path: Path) -> list[str]:
    """The variables that move the folder of ours in which `path` lies, or which cannot be made because of `path`:
    PLANETPOSE_CACHE for a file of the cache, and so on. Others of ours that cannot be made either come after it. Empty
    for a path that is no concern of theirs."""
    path = path.absolute()
    faulty, unusable = [], []
    for variable, folder in OWN_FOLDERS:
        try:
            own = folder().absolute()
        except RefusedError:
            continue
        if own in (path, *path.parents) or (path in own.parents and not path.is_dir()):
            faulty.append(variable)
        elif not _can_be_made(own):
            unusable.append(variable)
    return [*faulty, *unusable] if faulty else []


def _can_be_made(folder: Path) -> bool:
    existing = next((parent for parent in (folder, *folder.parents) if parent.exists()), Path("/"))
    return existing.is_dir() and os.access(existing, os.W_OK | os.X_OK)


OWN_FOLDERS = (
    ("PLANETPOSE_CACHE", cache_folder),
    ("PLANETPOSE_STATE", state_folder),
    ("PLANETPOSE_ARCHIVE", archive_folder),
)


def _own_folder(xdg: str, below_home: str, variable: str) -> Path:
    configured = os.environ.get(xdg)
    if configured:
        return Path(configured)
    try:
        return Path.home() / below_home
    except RuntimeError as error:
        raise RefusedError(
            Reason.HOME_UNKNOWN,
            "HOME is not set and this user has no home folder: there is no place for what planetpose keeps.",
            f"Set HOME, or {variable} and the like (PLANETPOSE_CACHE, PLANETPOSE_STATE), to folders of your own.",
        ) from error
