"""Whether distances are overestimated: the mean of the range factors that images want with their blur free."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tasks.adjust.measurement import Measurement
from tasks.joint.parameters import RANGE

Array = NDArray[np.float64]
SIGNIFICANT = 3.0


@dataclass(frozen=True)
class MeanFactor:
    """mean free range factor of one camera's images, its 1-sigma, the scatter between images beyond their errors, and
    the number of images. sigma is NaN for none."""

    camera: str
    mean: float
    sigma: float
    scatter: float
    count: int

    @property
    def verdict(self) -> str:
        """What the mean says of predicted distances."""
        surplus = (self.mean - 1) / self.sigma
        if abs(surplus) < SIGNIFICANT:
            return "no error of predicted distances is seen"
        return "predicted distances are overestimated" if surplus < 0 else "predicted distances are underestimated"

    @property
    def sentence(self) -> str:
        """For people."""
        return (
            f"{self.camera}: mean free range factor {self.mean:.5f} +- {self.sigma:.5f} of {self.count} "
            f"{'image' if self.count == 1 else 'images'}: {self.verdict}"
        )


def mean_factors(images: Sequence[Measurement]) -> list[MeanFactor]:
    """One per camera, by name; images whose range was held tell nothing and are left out."""
    solved = [image for image in images if not image.held[RANGE]]
    found = []
    for camera in sorted({image.camera.name for image in solved}):
        own = [image for image in solved if image.camera.name == camera]
        logs = np.array([image.step[RANGE] for image in own])
        variances = np.array([image.covariance[RANGE, RANGE] for image in own])
        mean, sigma, scatter = random_effects_mean(logs, variances)
        found.append(MeanFactor(camera, float(np.exp(mean)), sigma, scatter, len(own)))
    return found


def random_effects_mean(values: Array, variances: Array) -> tuple[float, float, float]:
    """Mean of `values` (n,) with `variances` (n,), its sigma, and the scatter beyond them, 1-sigma (DerSimonian and
    Laird 1986, Controlled Clinical Trials 7, 177)."""
    weight = 1 / variances
    mean = weight @ values / weight.sum()
    surplus = float(weight @ (values - mean) ** 2) - (len(values) - 1)
    spare = weight.sum() - weight @ weight / weight.sum()
    between = max(surplus / spare, 0.0) if len(values) > 1 else 0.0
    weight = 1 / (variances + between)
    return float(weight @ values / weight.sum()), float(1 / np.sqrt(weight.sum())), float(np.sqrt(between))


def survives(factors: Sequence[MeanFactor]) -> str:
    """The answer to the paper's "always overestimated distance", in a sentence."""
    if not factors:
        return "No image tells its range freely, so nothing is said of overestimated distances."
    over = [factor.camera for factor in factors if factor.verdict.endswith("overestimated")]
    verdict = (
        "does not survive when the blur is free"
        if not over
        else "survives when the blur is free"
        if len(over) == len(factors)
        else f"survives when the blur is free for {', '.join(over)} only"
    )
    parts = "; ".join(factor.sentence for factor in factors)
    return f"The paper's always overestimated distance (factors below 1) {verdict}. {parts}."
