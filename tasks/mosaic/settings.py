"""How a mosaic is made."""

import math
import re
from dataclasses import dataclass, field

from catalog.errors import WrongOptionError
from catalog.target import Target
from tasks.photometry.laws import STANDARD_GEOMETRY_DEG

WEIGHTS = ("sigma-resolution", "sigma", "resolution", "equal")
BANDS = ("none", "filter", "camera")
FORMATS = ("zarr", "cog", "stac")


@dataclass(frozen=True)
class MosaicSettings:
    """law: name of a photometric law; held, priors: its parameters that are not solved, or known with a 1-sigma (see
    `tasks.photometry.fit_settings`). projection, resolution: `4ppd`, `10km` or `500m`. weights: one of WEIGHTS. bands:
    one of BANDS, what images are kept apart by. units_per_if: image units per I/F. calibration_sigma: relative 1-sigma
    of the images' calibration against each other; None where nothing is known of it, as in images in data numbers of
    different exposures. outlier_sigma: values further from the others are left out. fade_deg: images fade out over so
    many degrees before the limits of the angles. cell_deg: size of the cells in which law and levels are solved.
    memory_mb: for the values of all images in one block of the map."""

    law: str = "hapke"
    held: dict[str, float] = field(default_factory=dict)
    priors: dict[str, tuple[float, float]] = field(default_factory=dict)
    projection: str = "equirectangular"
    resolution: str = "4ppd"
    central_longitude_deg: float | None = None
    max_incidence_deg: float = 75.0
    max_emission_deg: float = 75.0
    weights: str = "sigma-resolution"
    bands: str = "none"
    units_per_if: float | None = None
    calibration_sigma: float | None = None
    standard_deg: tuple[float, float, float] = STANDARD_GEOMETRY_DEG
    outlier_sigma: float = 5.0
    fade_deg: float = 12.0
    cell_deg: float = 2.0
    doubtful: bool = False
    memory_mb: float = 256.0

    def __post_init__(self) -> None:
        for option, given, known in (("weights", self.weights, WEIGHTS), ("bands", self.bands, BANDS)):
            if given not in known:
                raise WrongOptionError(option, f"there is no {given}.", f"Known are {', '.join(known)}.")


def pixel_size_km(resolution: str, target: Target) -> float:
    """Kilometres per pixel on the equator of `4ppd` (pixels per degree), `10km` or `500m`. Raises WrongOptionError for
    anything else."""
    found = re.fullmatch(r"\s*([0-9.eE+-]+)\s*(ppd|km|m)\s*", resolution)
    try:
        value = float(found[1]) if found else math.nan
    except ValueError:
        value = math.nan
    if not found or not math.isfinite(value) or value <= 0:
        raise WrongOptionError(
            "resolution", f"{resolution!r} is no resolution.", "Give for example 4ppd, 10km or 500m."
        )
    if found[2] == "ppd":
        return math.radians(1 / value) * target.mean_radius_km
    return value * (1.0 if found[2] == "km" else 1e-3)
