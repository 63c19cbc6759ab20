"""The cache of steps as a whole: what is in it, what killed processes left there, and what it need not keep."""

import shutil
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from catalog.unchanged import FOLDER as ANSWERS_FOLDER
from tasks.atomic import sweep_temporaries
from tasks.code_version import SOURCES_FOLDER
from tasks.record import RECORD_FILE, size_bytes
from tasks.registry import STEP_NAMES

IN_USE_S = 6 * 3600.0  # steps younger than this may belong to an image at work somewhere


def sweep_cache(cache: Path) -> None:
    """Delete the temporaries of dead processes."""
    sweep_temporaries(cache)
    for folder in key_folders(cache):
        sweep_temporaries(folder)


def step_folders(cache: Path) -> list[Path]:
    """The folders of steps, of what is known of their code, and of answers; nothing else in there is touched."""
    return [cache / kind for kind in (*STEP_NAMES, SOURCES_FOLDER, ANSWERS_FOLDER) if (cache / kind).is_dir()]


def clear_folders(folders: list[Path], step: str | None) -> list[Path]:
    """Delete those of the cache's folders that are of the step, or all, and return them; with any of them go the kept
    answers of commands, which would hide that steps are to be done again."""
    found = [folder for folder in folders if step in (None, folder.name)]
    answers = [folder for folder in folders if found and folder.name == ANSWERS_FOLDER]
    for folder in dict.fromkeys([*found, *answers]):
        shutil.rmtree(folder, ignore_errors=True)
    return found


def key_folders(cache: Path) -> Iterator[Path]:
    """The folders that results of steps lie in, by the first digits of their keys; links are not followed: what they
    lead to may be somebody else's."""
    for kind in STEP_NAMES:
        if not (cache / kind).is_symlink():
            yield from (each for each in (cache / kind).glob("[0-9a-f][0-9a-f]") if not each.is_symlink())


@dataclass(frozen=True)
class CachedStep:
    """One result in the cache. used: when it was written or last used (seconds since the epoch)."""

    folder: Path
    used: float


def cached_steps(cache: Path) -> Iterator[CachedStep]:
    """All results of steps in a cache."""
    for folder in key_folders(cache):
        for record in folder.glob(f"[!.]*/{RECORD_FILE}"):
            with suppress(OSError):
                if not record.parent.is_symlink():
                    yield CachedStep(record.parent, record.stat().st_mtime)


def prune(cache: Path, limit_gb: float | None = None, days: float | None = None, keep_s: float = IN_USE_S) -> int:
    """Delete results that nobody used for `days`, then the longest unused until the rest is within `limit_gb`; none
    that was used in the last `keep_s`. Products do not need them; a step that comes up again is done again. Returns
    how many bytes were freed."""
    if limit_gb is None and days is None:
        return 0
    now, freed = time.time(), 0
    steps = sorted(cached_steps(cache), key=lambda step: step.used)
    sizes = {step.folder: size_bytes(step.folder) for step in steps}
    total = sum(sizes.values())
    for step in steps:
        age_s = now - step.used
        old = days is not None and age_s > days * 86400
        much = limit_gb is not None and total - freed > limit_gb * 1e9
        if age_s > keep_s and (old or much):
            shutil.rmtree(step.folder, ignore_errors=True)
            freed += sizes[step.folder]
    return freed
