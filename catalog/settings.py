"""Where things are on this machine: real data, kernels, cache. Everything comes from the environment."""

import os
from pathlib import Path

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
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "planetpose"


def state_folder() -> Path:
    """Folder of what outlives a command (the local Prefect server and its database): PLANETPOSE_STATE, else XDG's."""
    configured = os.environ.get("PLANETPOSE_STATE")
    if configured:
        return Path(configured)
    return Path(os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state") / "planetpose"


def archive_folder() -> Path:
    """Folder that `planetpose fetch` fills and image lists look in: PLANETPOSE_ARCHIVE, else the user's data folder."""
    configured = os.environ.get("PLANETPOSE_ARCHIVE")
    if configured:
        return Path(configured)
    return Path(os.environ.get("XDG_DATA_HOME") or Path.home() / ".local" / "share") / "planetpose" / "archive"
