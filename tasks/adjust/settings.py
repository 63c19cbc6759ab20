"""Settings of the adjustment."""

from pydantic import BaseModel, ConfigDict, Field


class AdjustSettings(BaseModel):
    """gap_s: images of one camera and target that are no further apart in time are of one sequence. focal_relative,
    psf_relative: 1-sigma of the camera's constants beforehand (range and roll take the images' own priors).
    map_deg: error of the attitude that all images of one map share, added to a sequence's. limit_*: the largest scatter
    of single images about what they share that is looked for. robust_sigmas: images further off, per unknown, weigh
    less."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    gap_s: float = Field(300.0, gt=0)
    focal_relative: float = Field(5e-4, gt=0)
    psf_relative: float = Field(0.5, gt=0)
    map_deg: float = Field(0.15, ge=0)
    limit_range: float = Field(0.05, gt=0)
    limit_deg: float = Field(5.0, gt=0)
    limit_psf: float = Field(1.0, gt=0)
    robust_sigmas: float = Field(2.0, gt=0)
