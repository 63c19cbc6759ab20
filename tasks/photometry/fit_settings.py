"""What a fit of a photometric law takes as known."""

from dataclasses import dataclass, field


@dataclass(frozen=True)
class FitSettings:
    """calibration_sigma: relative 1-sigma of the images' calibration against each other; 0 holds all factors at 1.
    units_per_if: image units per I/F, so that albedos are I/F; None leaves them in image units, and has laws that need
    I/F solve one factor for all images, so that w comes from the shape of the brightness alone. held: parameters not to
    be solved, with their values. priors: parameters with their expected values and 1-sigma. bounds: limits instead of
    the law's own. bootstrap: how many times the fit is repeated with patches of ground drawn anew; 0 leaves the
    uncertainties to the covariance."""

    calibration_sigma: float = 0.05
    units_per_if: float | None = None
    held: dict[str, float] = field(default_factory=dict)
    priors: dict[str, tuple[float, float]] = field(default_factory=dict)
    bounds: dict[str, tuple[float, float]] = field(default_factory=dict)
    bootstrap: int = 0
    seed: int = 1
