"""Settings of what is accepted, and of when the corrections rest."""

from pydantic import BaseModel, ConfigDict, Field


class AcceptSettings(BaseModel):
    """When a corrected pose is accepted. max_limb_rms_px: None takes any. require_limb: a pose whose limb could not be
    measured is not accepted. min_likeness, sure_likeness: correlation of image and simulation, see `tasks.validate`;
    below the first the pose is not accepted, below the second it is doubtful. sure_limb_rms_px: with a limb further off
    the pose is doubtful; None doubts none. A limb is that far off by its robust RMS, see `tasks.validate`: segments
    that lock onto an edge of the surface are no doubt, unless more than limb_share of them lie elsewhere. sure_blur:
    where something else is doubted, a limb so many times as wide as simulated is named first; sure_blocks: and steps so
    many times as large at the edges of compression's blocks as elsewhere. sun_across_deg,
    sun_phase_deg: where the image puts the Sun elsewhere than the metadata do by more than four of its errors and more
    than so much, as an angle on the sky across the plane of the phase angle and in it, the pose is doubtful; None is
    not tested. sure_psf: a solution with a PSF so many times as wide as the limb shows is doubtful (images of another
    renderer, sharp, smeared and blurred by up to 6 px: at most 1.4; a Sun that is 10 deg off: 3.7). sure_range: where
    no markings show which body it is, a range that is stated to be known so well, relative, does: moons of one planet
    mostly differ by more in their radii. sure_markings: markings that correlate with the map's by so many sigmas of
    chance do, too, though they do not single out the orientation (chance: 1 in 700)."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    max_limb_rms_px: float | None = Field(3.0, gt=0)
    sure_limb_rms_px: float | None = Field(None, gt=0)
    sun_across_deg: float | None = Field(5.0, gt=0)
    sun_phase_deg: float | None = Field(10.0, gt=0)
    limb_share: float = Field(0.2, gt=0, le=1)
    require_limb: bool = True
    sure_blur: float = Field(2.5, gt=1)
    sure_psf: float = Field(2.0, gt=1)
    sure_markings: float = Field(3.0, gt=0)
    sure_range: float = Field(0.05, gt=0)
    sure_blocks: float = Field(1.6, gt=1)
    min_likeness: float = Field(0.6, ge=-1, le=1)
    sure_likeness: float = Field(0.8, ge=-1, le=1)


class StillSettings(BaseModel):
    """A pass whose every correction is smaller than these is the last."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    offset_px: float = Field(0.03, ge=0)
    range_factor: float = Field(1e-4, ge=0)
    attitude_deg: float = Field(0.03, ge=0)
