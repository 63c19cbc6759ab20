"""How a base map is improved."""

from dataclasses import dataclass, field

from catalog.errors import WrongOptionError
from tasks.control.settings import ControlSettings
from tasks.improve.frame import FRAMES, Feature
from tasks.mosaic.settings import MosaicSettings

# Smaller than of ties between two images: disks are some hundred pixels wide, and the map of many images has less noise
# (57 simulated images of Europa: 21 px leave 0.19 degrees at disks of 100 px, 15 px 0.15).
PATCH_PX = 15
# What a base map displaces orientations by, beside its frame, at least (1-sigma about each axis): that of 13 simulated
# images of Europa by LORRI against another map, 0.03 degrees.
LEAST_ATTITUDE_DEG = 0.03


def usual_patches(points: int = 2400, least_correlation: float = 0.7) -> ControlSettings:
    """Patches that images are matched with the map by: more of them than ties, and weaker, as each is only matched with
    the mean of all other images."""
    return ControlSettings(
        points=points, patch_px=PATCH_PX, least_correlation=least_correlation, least_attitude_deg=LEAST_ATTITUDE_DEG
    )


@dataclass(frozen=True)
class ImproveSettings:
    """mosaic: how images are combined; equirectangular, all bands together. patches: how they are matched with the map,
    and what is known of their poses beforehand. rounds: at most. still: the iteration ends when orientations move by
    less than this share of their sigma (median over the images). hold_frame: one of FRAMES, what the mean orientation
    of all images is held by; features: for `feature`. old_weight: weight of the old base map where images see the
    ground, as a share of their usual weight: it makes the transition to where none does a smooth one."""

    mosaic: MosaicSettings = field(default_factory=lambda: MosaicSettings(law="lunar-lambert"))
    patches: ControlSettings = field(default_factory=usual_patches)
    rounds: int = 5
    still: float = 0.1
    hold_frame: str = "map"
    features: tuple[Feature, ...] = ()
    old_weight: float = 0.02

    def __post_init__(self) -> None:
        if self.hold_frame not in FRAMES:
            raise WrongOptionError("hold-frame", f"there is no {self.hold_frame}.", f"Known are {', '.join(FRAMES)}.")
        if (self.hold_frame == "feature") != bool(self.features):
            raise WrongOptionError(
                "feature", "features hold the frame, and only they do.", "Give --hold-frame feature and --feature."
            )
        if self.mosaic.projection != "equirectangular" or self.mosaic.bands != "none":
            raise WrongOptionError("projection", "a base map is equirectangular.", "Leave the option out.")
