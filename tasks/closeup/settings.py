"""Settings of the correction of close-ups."""

from pydantic import BaseModel, ConfigDict, Field

from tasks.joint.settings import Group


class CloseUpSettings(BaseModel):
    """share: a frame that shows less than this part of the target's disk, wherever within reach the target is, is a
    close-up and registered against the base map. reach_px: how far from its predicted place the surface is looked for,
    undistorted pixels. sigmas: how far roll and range are looked for, in sigmas of their priors. max_roll_deg,
    max_range: and no farther than this; degrees, share of the range. map_pixel_px: the frame is compared at a
    resolution of so many of its pixels per pixel of the map. largest_px: and the first search at no more than so many
    pixels across. patches: across the longer side of the frame. min_map_pixels: of the map across the shorter side of
    what is seen. false_alarm: largest probability that chance gives as good a match in all that was searched;
    above it the result is doubtful, above no_match nothing is found. max_sigma_map_px: a solution whose patches know
    the place less well, 1-sigma, map pixels, is doubtful. map_error_px: what a base map's own errors of place add,
    1-sigma along each axis, map pixels (tiles of two maps of
    Europa, 2048 pixels around, differ by 0.28 in the median and 1.0 in the worst tenth, of Io by 0.12 and 0.21, beside
    what their frames differ by). hold: roll, range or attitude that
    stay as they are."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    share: float = Field(0.25, ge=0, le=1)
    reach_px: float = Field(160.0, gt=0)
    sigmas: float = Field(3.0, gt=0)
    max_roll_deg: float = Field(3.0, gt=0, le=45)
    max_range: float = Field(0.06, gt=0, lt=0.5)
    map_pixel_px: float = Field(2.0, ge=1)
    largest_px: int = Field(256, ge=32)
    patches: int = Field(8, ge=3, le=32)
    min_map_pixels: float = Field(16.0, ge=4)
    false_alarm: float = Field(1e-4, gt=0, lt=1)
    no_match: float = Field(1e-2, gt=0, lt=1)
    max_sigma_map_px: float = Field(0.5, gt=0)
    map_error_px: float = Field(0.35, ge=0)
    hold: tuple[Group, ...] = ()
