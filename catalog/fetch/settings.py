"""How patient, how fast and how large."""

import os

from pydantic import BaseModel, ConfigDict, Field


class FetchSettings(BaseModel):
    """attempts: per file. first_wait_s doubles between them up to longest_wait_s; a server's Retry-After counts up to
    the latter too. stall_timeout_s: silence that ends an attempt; slowest_bytes_per_s: average, after that time.
    requests_per_s: to one host. largest_bytes: of one file."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    attempts: int = Field(default=4, ge=1, le=20)
    first_wait_s: float = Field(default=1.0, ge=0)
    longest_wait_s: float = Field(default=60.0, ge=0)
    connect_timeout_s: float = Field(default=10.0, gt=0)
    stall_timeout_s: float = Field(default=30.0, gt=0)
    slowest_bytes_per_s: float = Field(default=200.0, ge=0)
    requests_per_s: float = Field(default=4.0, gt=0)
    largest_bytes: int = Field(default=2_000_000_000, gt=0)
    workers: int = Field(default=4, ge=1, le=16)
    user_agent: str = "planetpose (image lists; one request at a time per file)"


def default_mirror() -> str | None:
    """PLANETPOSE_MIRROR: the URL or folder that stands for all archives, None when it is not set."""
    return os.environ.get("PLANETPOSE_MIRROR") or None
