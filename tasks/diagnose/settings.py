"""Settings of the diagnosis."""

from pydantic import BaseModel, ConfigDict, Field


class DiagnoseSettings(BaseModel):
    """What is tried where an image has no corrected pose, always without the map's markings. sizes: widths of the disk,
    relative to the predicted one. azimuths, phases_deg: directions of the Sun, so many around the picture at each phase
    angle. blurs: sigmas of a blur, by the predicted disk's radius. trails, trail_directions: lengths of a motion smear,
    by that radius, and in how many directions. spread_likeness: where a blur or a smear leaves no limb to be measured,
    image and simulation must correlate by so much (measured on planted ones: 0.98 and more). diameter_px, frame_px: the
    search is made at a resolution that brings the disk, or else the frame, to about so many, on image and simulation
    clipped at the share clip_at of their highest brightness, so that clouds do not mislead; only what correlates there
    by least_score, and less than `worth` below the best, is settled, on a disk of at most settle_px. least_likeness,
    least_limb: an explanation is good when image and simulation correlate by so much, and when the limb lies where the
    explanation has it, within limb_px or limb_share of the radius, on the share least_limb of its lit segments.
    sure_likeness: where no limb confirms it, a target counts as found when they correlate by so much. better: it is
    preferred to another one that leaves so many times its mean square unexplained. false_alarm: probability that, of
    all that was tried, one were so much better, or fitted at all, by accident. markings: a picture counts as mirrored
    or turned when its markings then correlate with the map's by so much, and by markings_better more than otherwise; by
    less, the map counts as another one. same_size, summed_size: a disk whose width differs by less is as large as
    predicted, or as in another summing mode. incomplete: share of the frame's pixels without which it counts as
    incomplete. bodies: a catalog body is named where its disk would be so nearly as wide as the image's. limb_left:
    share of the lit limb that must be measurable; below it the reason says what covers the rest. blocks: a picture
    counts as spoilt by compression where steps are so many times as large at the edges of its blocks (measured: 1.0-1.2
    without, 2.9 and more at JPEG's lowest qualities)."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    sizes: tuple[float, ...] = Field((0.4, 0.5, 0.6, 0.7, 0.8, 0.88, 1.13, 1.25, 1.45, 1.7, 2.0, 2.5), min_length=1)
    blurs: tuple[float, ...] = (0.06, 0.12, 0.2)
    trails: tuple[float, ...] = (0.5, 0.8)
    trail_directions: int = Field(6, ge=2, le=36)
    azimuths: int = Field(8, ge=4, le=36)
    phases_deg: tuple[float, ...] = Field((25.0, 70.0, 115.0), min_length=1)
    diameter_px: float = Field(40.0, gt=8)
    frame_px: float = Field(300.0, gt=16)
    clip_at: float = Field(0.2, gt=0, le=1)
    settle_px: float = Field(300.0, gt=0)
    least_score: float = Field(0.4, ge=-1, le=1)
    worth: float = Field(0.12, ge=0)
    least_likeness: float = Field(0.65, ge=-1, le=1)
    sure_likeness: float = Field(0.85, ge=-1, le=1)
    spread_likeness: float = Field(0.97, ge=-1, le=1)
    least_limb: float = Field(0.5, gt=0, le=1)
    limb_px: float = Field(1.0, gt=0)
    limb_share: float = Field(0.01, ge=0)
    better: float = Field(1.5, ge=1)
    false_alarm: float = Field(1e-3, gt=0, lt=1)
    markings: float = Field(0.4, gt=0, le=1)
    markings_better: float = Field(0.2, ge=0)
    same_size: float = Field(0.05, gt=0)
    summed_size: float = Field(0.04, gt=0)
    incomplete: float = Field(0.2, gt=0, le=1)
    bodies: float = Field(0.01, gt=0)
    blocks: float = Field(1.6, gt=1)
    limb_left: float = Field(0.25, ge=0, le=1)
