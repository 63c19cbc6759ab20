"""Settings of the joint estimator."""

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from tasks.joint.thresholds import Thresholds
from tasks.priors import SourcePriors
from tasks.simulate.photometry import LawName

Group = Literal["offset", "range", "roll", "attitude", "psf"]


class SystematicSettings(BaseModel):
    """Errors of map, photometric laws, distortion and PSF that the scatter of the residuals does not show, 1-sigma:
    centre_px of the centre, limb_px of the radius; attitude_deg of the target's attitude, beside what grows with the
    size of a pixel (`across_px` of the thresholds of orientation), and roll_deg of the camera's roll, which the
    shading shows beside its prior. local_px: the same of places along the limb that err apart from one pixel to the
    next; centre and radius average it over the limb's length, so that it falls by the root of the radius (radius below
    25 px: 61 scenes had 63 % of the centres and 61 % of the ranges within 1 sigma without it, 71 and 70 % with it;
    larger disks as before). limb_gain: centre_px and limb_px are of maps whose brightness along the limb is
    right to so much, relative (see `tile_prior.limb_gain`); where it is off by more, they grow (see `times_usual`).
    distortion_share: part of the distortion model's error that the disk's limb does not average out. On 60 scenes of
    the honesty benchmark, six laws, radius 12-140 px, whose maps are right to 2-6 %, 77 % of the ranges and 73 % of
    the centres (each coordinate) lay within 1 sigma, 98 and 97 % within 2."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    centre_px: float = Field(0.008, ge=0)
    limb_px: float = Field(0.025, ge=0)
    local_px: float = Field(0.05, ge=0)
    attitude_deg: float = Field(0.03, ge=0)
    roll_deg: float = Field(0.03, ge=0)
    limb_gain: float = Field(0.05, gt=0)
    distortion_share: float = Field(0.25, ge=0)


class TileSettings(BaseModel):
    """Tiles with a gain of their own. side_px, side_share: length of a side, pixels, and at least this share of the
    disk's radius. limb_px, limb_share: the same of the depth of the ring of sectors along the limb. gain,
    slope: what a tile's factor and its change over half a tile are off by, 1-sigma, before the fit; veil: the same of
    light scattered into it, as a share of the disk's brightness. 0 holds them."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    side_px: float = Field(12.0, gt=0)
    side_share: float = Field(0.12, ge=0)
    limb_px: float = Field(3.0, gt=0)
    limb_share: float = Field(0.03, ge=0)
    gain: float = Field(0.3, ge=0)
    slope: float = Field(0.3, ge=0)
    veil: float = Field(0.05, ge=0)
    fewest: int = Field(8, gt=0, description="Tiles from which the others' gains are learned. Choice.")
    smallest: float = Field(1e-3, gt=0, description="1-sigma of a gain, relative, at least: no map is better. Choice.")
    heavy_tail: float = Field(
        4.0,
        gt=0,
        description="A tile may be off by so many times the spread of all: maps are wrong in patches. Choice.",
    )
    chance: float = Field(2.0, gt=0, description="A surplus of fewer sigmas is chance: the tiles are then held.")
    seen: float = Field(
        4.0,
        gt=0,
        description="A tile counts when the image has so many times the prior's information on its gain. Choice.",
    )

    @property
    def sigmas(self) -> tuple[float, ...]:
        """1-sigma of a tile's unknowns: gain, its two slopes, veil."""
        return (self.gain, self.slope, self.slope, self.veil)


class SmearSettings(BaseModel):
    """When the PSF is solved for as other than a round Gaussian. significance: of an uneven second moment, sigmas, and
    least_px: length of the trail, pixels, from which a trail is an unknown of the image (sharp images of another
    renderer, three laws, radius 25-110 px: at most 3.1 and 0.95 px; trails of 2 px and more: at least 5.7).
    wings_share: share of the light beyond which the PSF's wings are taken for a wider PSF (sharp: below 0.02; 3 px:
    0.9)."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    significance: float = Field(4.0, gt=0)
    least_px: float = Field(1.0, gt=0)
    wings_share: float = Field(0.3, gt=0)


class JointSettings(BaseModel):
    """mapped: laws that shade the base map, each with a weight of its own. plain: laws that shade a body without
    markings; they set the map's contrast. law_weight: how large, relative to the picture's brightness, a law's weight
    is before the fit, 1-sigma, so that they do not cancel each other. tiles: local errors of map and laws. wings_px:
    widths of the PSF's wings (scattered light, haze); wings_sigma: the share of light that they hold before the fit,
    1-sigma. hidden_sigma: how far from 1 the share is, 1-sigma before the fit, that the disk hides of the light of a
    body behind it. smear: exposures during which the boresight drifted. background: sky level, or a plane. hold:
    unknowns that stay as they are. edge_px: error of places in the image, at first and at most. terminator: cosine of
    incidence below which the photometric laws are not trusted. second_start: solve again from elsewhere, and doubt the
    result when it ends elsewhere. limb_led_px: where the product's limb lies farther (RMS) from the image's own, or
    contradicts it by its errors, the limb leads; None never. bending_px: where the disk shows the beam to bend
    otherwise than the marks say, by at least so many pixels (RMS), the image is displaced by it; None never.
    displaced_px: what each term of a smooth displacement that no distortion model tells of is before the fit, pixels at
    the limb, 1-sigma; where limb and markings show one, the errors hold what it does to the solution; None takes optics
    for exact. diameter_px: disks of which more is in
    the frame than a whole one of this size has are solved at reduced resolution; first_diameter_px: the same on the way
    there, where fine markings would catch the solution in the wrong place."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    mapped: tuple[LawName, ...] = Field(
        ("lambert", "lommel-seeliger", "mu0-mu", "mu0-squared", "minnaert-half"), min_length=1
    )
    plain: tuple[LawName, ...] = ("lambert", "lommel-seeliger")
    law_weight: float = Field(3.0, gt=0)
    tiles: TileSettings = TileSettings()
    wings_px: tuple[float, ...] = (3.0, 10.0)
    wings_sigma: float = Field(0.1, gt=0)
    hidden_sigma: float = Field(0.05, gt=0)
    smear: SmearSettings = SmearSettings()
    background: Literal["constant", "plane"] = "plane"
    hold: tuple[Group, ...] = ()
    priors: SourcePriors = SourcePriors()
    systematic: SystematicSettings = SystematicSettings()
    second_start: bool = True
    limb_led_px: float | None = Field(0.3, gt=0)
    bending_px: float | None = Field(0.02, ge=0)
    displaced_px: float | None = Field(0.3, gt=0)
    diameter_px: float = Field(450.0, gt=0)
    first_diameter_px: float = Field(220.0, gt=0)
    edge_px: float = Field(0.1, ge=0)
    terminator: float = Field(0.1, ge=0, lt=1)
    huber: float = Field(2.5, gt=0)
    max_iterations: int = Field(10, ge=1, le=100)
    oversample: int | None = Field(None, ge=1, le=16)
    thresholds: Thresholds = Thresholds()
