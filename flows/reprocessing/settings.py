"""What a reprocessing run is asked for."""

import os
from pathlib import Path

from pydantic import BaseModel, ConfigDict, Field

from catalog.settings import cache_folder
from flows.defaults import DEFAULT_PROFILE

BOOKS = ".reprocess"  # hidden: no product is called so, and the store's index passes it over


class Limits(BaseModel):
    """What one image may cost. image_timeout_s: after that its process is killed. image_memory_mb: of its process; more
    kills it. retries, retry_delay_s: for faults that can pass; every further delay is three times as long.
    tries: how many runs take up an image that hung, or whose process died, while nothing about it changes."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    image_timeout_s: float = Field(1800.0, gt=0)
    image_memory_mb: float = Field(6000.0, gt=0)
    retries: int = Field(2, ge=0, le=20)
    retry_delay_s: float = Field(10.0, ge=0)
    tries: int = Field(3, ge=1)

    @property
    def delays_s(self) -> list[float]:
        """Seconds before each retry."""
        return [self.retry_delay_s * 3**number for number in range(self.retries)]


class Settings(BaseModel):
    """images: an image list, by name or file. store: where products are published. publish_to: URL of an object store
    that they are then copied to. only: shell patterns of products. kernels: for images whose list names none; None
    takes those of the environment. force: do also what is unchanged (steps that are cached stay). again: do also what
    was refused or failed before. verify: compare every product with its checksums. workers: images at a time, 0: one
    per processor. runner: see `flows.runners`; whichever it is, every image is done by a process of its own. fetch:
    first get what the list names and is not there. archive: folder of fetched files. cache: of steps. cache_limit_gb,
    cache_days: what is pruned of it after the run. most_failed_percent: of the list; more failures than that make the
    run fail and raise the alarm."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    images: str = Field(min_length=1)
    store: Path
    publish_to: str | None = None
    profile: str = DEFAULT_PROFILE
    only: tuple[str, ...] = ()
    kernels: tuple[Path, ...] | None = None
    workers: int = Field(0, ge=0)
    runner: str = "threads"
    force: bool = False
    again: bool = False
    verify: bool = False
    fetch: bool = False
    archive: Path | None = None
    cache: Path = Field(default_factory=cache_folder)
    cache_limit_gb: float | None = Field(None, ge=0)
    cache_days: float | None = Field(None, ge=0)
    most_failed_percent: float = Field(5.0, ge=0, le=100)
    limits: Limits = Limits()

    @property
    def books(self) -> Path:
        """Folder of what is remembered about images and runs."""
        return self.store / BOOKS

    @property
    def at_a_time(self) -> int:
        """Images at a time."""
        return self.workers or processors()


def processors() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
