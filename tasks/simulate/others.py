"""Settings of what other bodies mean to an image."""

from pydantic import BaseModel, ConfigDict, Field


class OtherBodiesSettings(BaseModel):
    """Which other bodies than the target concern an image, what is left out of it around them, and what is measured
    of them: margins beyond a body's edge add up."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    beside_frame: float = Field(
        0.5,
        ge=0,
        description="A body outside the frame counts where a pointing error of this share of the frame's side would "
        "bring it in: labels are off by up to half a frame.",
    )
    least_radius_px: float = Field(
        0.1,
        ge=0,
        description="Bodies of a smaller radius are left out: neither disk nor shadow of theirs fills a hundredth of a "
        "pixel.",
    )
    blur_sigmas: float = Field(
        4.0, ge=0, description="Margin of a body's edge, in widths of the PSF: 3e-5 of an edge's light is beyond."
    )
    pixel_px: float = Field(1.0, ge=0, description="The same in pixels: a pixel's own width.")
    place_sigmas: float = Field(
        3.0, ge=0, description="The same in 1-sigma errors of the body's place relative to the target (`sigma_km`)."
    )
    least_loss: float = Field(
        0.005,
        gt=0,
        lt=1,
        description="Shadows and rings that take less of the light are left alone: a tenth of what maps are off by.",
    )
    kept_px: float = Field(
        12.0, ge=0, description="A body behind the target is left out from so far beyond the target's limb on. Choice."
    )
    kept_radii: float = Field(0.05, ge=0, description="The same in radii of the target, added. Choice.")
    kept_sigmas: float = Field(4.0, ge=0, description="The same in widths of the PSF, added; as blur_sigmas.")
    least_lit_px: float = Field(
        40.0, gt=0, description="Width of a disk's sunlit part from which its place is measured: some hundred segments."
    )
    least_shine: float = Field(
        0.001,
        gt=0,
        description="Light of another body that is at least this share of the sunlight lights the target, too. Less is "
        "lost in the noise of a night side: a tenth of what Jupiter throws on Io.",
    )
    least_night: float = Field(
        0.25,
        ge=0,
        le=1,
        description="The same is looked at where the night side takes this share of the disk's width or more (0.25: "
        "from a phase angle of 60 degrees on): elsewhere sunlight drowns it.",
    )
    roll_centre_px: float = Field(
        0.2,
        gt=0,
        description="1-sigma of the target's centre before the joint step, where other bodies tell the camera's roll: "
        "what the search by limb and pixels leaves.",
    )
    roll_edge_px: float = Field(
        0.15,
        gt=0,
        description="There an edge of a limb is known no better than this, 1-sigma: neighbours err together.",
    )
    roll_range: float = Field(
        0.01, gt=0, description="There the range is known to this share at least, 1-sigma: the disk is in the frame."
    )
    roll_gain: float = Field(
        0.9,
        gt=0,
        le=1,
        description="Other bodies give the roll where its error is then this share of its prior's, or less. Choice.",
    )
    roll_sigmas: float = Field(
        4.0,
        gt=0,
        description="Not taken is a roll that is so many 1-sigma errors from its prior, and an edge so many from the "
        "others: it is of something else. One of 16 000 by chance.",
    )
