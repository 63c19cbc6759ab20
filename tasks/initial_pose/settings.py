"""Settings of the pose that is found in the image alone."""

from pydantic import BaseModel, ConfigDict, Field


class LimbSearchSettings(BaseModel):
    """Where the limb is. edge_sigmas: an edge's brightness gradient, in sigmas of that of the frame's noise. draws:
    pairs of edge points that a circle is tried through. tolerance_px, tolerance_share: how far from a circle its
    points lie at most, pixels and share of its radius (an oblate body's limb is none). least_radius_px: smaller
    disks are not looked for. arc_deg: the limb's least extent, known_arc_deg: the same where kernels give the
    range. disk_share: the least part of a disk of unknown range in the frame. radius_sigma: the largest 1-sigma
    of the radius, relative, that an arc may leave: the corrections search the range within a few per cent.
    outside_share: brightness outside an edge, as a share of that inside, above which it is none of a limb. Of a
    disk, likeness: the least correlation of the image with a lit sphere of its limb and the sky around it
    (bodies on 14 real frames: 0.81 and more; craters and clouds: 0.75 and less, but for specks); lit_share: the
    least part of its sunlit limb within the frame that is an edge; sky_share: the brightest sky beside its limb,
    as a share of the brightness inside; ring_share: the largest part of a ring around it that is lit."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    edge_sigmas: float = Field(6.0, gt=0)
    draws: int = Field(6000, ge=100)
    tolerance_px: float = Field(1.5, gt=0)
    tolerance_share: float = Field(0.01, ge=0)
    least_radius_px: float = Field(4.0, gt=0)
    arc_deg: float = Field(45.0, gt=0, le=360)
    known_arc_deg: float = Field(20.0, gt=0, le=360)
    radius_sigma: float = Field(0.04, gt=0)
    disk_share: float = Field(0.15, ge=0, le=1)
    outside_share: float = Field(0.85, gt=0, le=1)
    likeness: float = Field(0.78, ge=0, le=1)
    lit_share: float = Field(0.6, ge=0, le=1)
    sky_share: float = Field(0.5, ge=0, le=1)
    ring_share: float = Field(0.25, ge=0, le=1)


class MapSearchSettings(BaseModel):
    """The global search over sub-spacecraft point and north azimuth. step_deg: of the grid of orientations.
    diameter_px: of the disk at whose resolution the grid is searched. followed: best orientations of the grid that are
    moved uphill, compared: distinct ones of them that are compared by markings of half the size (of a disk of 324 px at
    32 deg of phase the right one was the 23rd before, the first then), kept: those of these that are refined, and
    refined_kept: those of them compared at full resolution.
    least_radius_px: on smaller disks markings are not looked for. distinct_deg: orientations farther apart than this
    are different ones. sigmas: evidence of the best orientation, as sigmas, and times_next: how many times that of the
    next distinct one it must be, beside a constant of 16 (squares of sigmas), as of every test of markings. sigma_deg:
    1-sigma about each axis of an orientation so found, from which the corrections start."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    step_deg: float = Field(6.0, gt=0, le=20)
    diameter_px: float = Field(40.0, gt=0)
    followed: int = Field(600, ge=1)
    compared: int = Field(200, ge=1)
    kept: int = Field(16, ge=1)
    refined_kept: int = Field(6, ge=1)
    least_radius_px: float = Field(12.0, gt=0)
    distinct_deg: float = Field(12.0, gt=0)
    sigmas: float = Field(6.0, gt=0)
    times_next: float = Field(2.0, ge=1)
    sigma_deg: float = Field(2.0, gt=0)


class ImagePoseSettings(BaseModel):
    """The pose that is found in the image itself. limb, map: see there. sun_sigma_deg: 1-sigma of a body's direction to
    the Sun by terminator and shading, laws and markings included, at the least; rough_sun_deg: the same where least
    squares on the whole disk do not come to rest, mostly near opposition, where shading tells little (on four
    simulated images at 3 deg of phase the Sun came out 2 to 10 deg off); time_sun_sigma_deg: the same about each axis
    where time and orientation place the Sun (41 simulated images of bodies up to 1.7 deg off their rotation model: RMS
    0.6 deg). same_sigmas: what differs by less than so many
    sigmas is the same: range and Sun of the time and of the image, the limb's circle and the whole disk's.
    range_prior_times, range_prior_share: the corrections look at the same limb again, and what it showed beforehand is
    no second measurement of the range: its prior is so many times as wide as its error, and at least this share (that
    of a pose file)."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    sun_sigma_deg: float = Field(1.0, gt=0)
    rough_sun_deg: float = Field(6.0, gt=0)
    time_sun_sigma_deg: float = Field(0.7, gt=0)
    same_sigmas: float = Field(4.0, gt=0)
    range_prior_times: float = Field(4.0, ge=1)
    range_prior_share: float = Field(0.02, gt=0)
    limb: LimbSearchSettings = LimbSearchSettings()
    map: MapSearchSettings = MapSearchSettings()
