"""How tie points are found and poses adjusted."""

from dataclasses import dataclass

from catalog.errors import WrongOptionError
from tasks.photometry.laws import LAWS


@dataclass(frozen=True)
class ControlSettings:
    """points: places on the body that are tried, evenly spread. patch_px: side of a patch, in pixels of the coarser
    image. search_px: how far a match may lie from where the poses have it. least_correlation: of a match. law: what
    patches are divided by. max_incidence_deg, max_emission_deg: of a patch's middle. most_ratio: of the resolutions of
    two images that are matched. prior_attitude_deg, prior_offset_px, prior_range, prior_roll_deg: 1-sigma of the poses
    where products state none; least_attitude_deg: what they are taken to be at least. free_radius: points may lie above
    or below the shape, radius_sigma: relative 1-sigma. reject_sigma: measures further off are left out. solve: what of
    the cameras is solved, too (focal-length, distortion); prior_distortion_px: 1-sigma of what a camera's own model of
    its distortion leaves in the corner of the frame (Voyager's and SSI's: 0.2 to 1 px)."""

    points: int = 1200
    patch_px: int = 21
    search_px: int = 4
    least_correlation: float = 0.8
    law: str = "lunar-lambert"
    max_incidence_deg: float = 75.0
    max_emission_deg: float = 65.0
    most_ratio: float = 3.0
    prior_attitude_deg: float = 0.1
    prior_offset_px: float = 0.3
    prior_range: float = 1e-3
    prior_roll_deg: float = 0.05
    least_attitude_deg: float = 0.0
    free_radius: bool = False
    radius_sigma: float = 1e-3
    reject_sigma: float = 4.0
    doubtful: bool = False
    solve: tuple[str, ...] = ()
    prior_distortion_px: float = 1.0

    def __post_init__(self) -> None:
        if self.law not in LAWS:
            raise WrongOptionError("law", f"there is no {self.law}.", f"Known are {', '.join(LAWS)}.")
        if self.patch_px % 2 == 0 or self.patch_px < 7:
            raise WrongOptionError(
                "patch-px", f"patches of {self.patch_px} pixels have no middle.", "Give 7, 9, 11 ..."
            )
