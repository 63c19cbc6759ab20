"""Whether the PSF is another than the round Gaussian that was solved for: smeared along a line, or much wider.

To second order in a trail's length L the smeared image differs from one with a wider round PSF by

    L^2/12 [cos(2a) (Ixx - Iyy) / 4 + sin(2a) Ixy / 2]

(a: direction, Ixx ... second derivatives of the image), which is linear and shows whether there is a trail at all.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tasks.joint.gauss_newton import Solution
from tasks.joint.normal_equations import solve_linear
from tasks.joint.parameters import State
from tasks.joint.settings import SmearSettings

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SecondMoment:
    """Of the PSF along the axes turned by 0 and 45 deg, px^2: what the trail adds unevenly, (2,), and its covariance
    (2, 2) by the weights of the pixels. The covariance by clusters of residuals would not do: what a trail leaves in
    the residuals of a round PSF is itself a cluster."""

    value: Array
    covariance: Array

    @property
    def significance(self) -> float:
        """In sigmas."""
        return float(np.sqrt(self.value @ np.linalg.solve(self.covariance, self.value)))

    @property
    def trail_px(self) -> tuple[float, float]:
        """The trail (x, y) of this moment; its sign has no meaning."""
        length = np.sqrt(12 * np.hypot(*self.value))
        angle = 0.5 * np.arctan2(self.value[1], self.value[0])
        return float(length * np.cos(angle)), float(length * np.sin(angle))


def uneven_moment(solution: Solution) -> SecondMoment:
    """What the solution's last linear problem says of a trail, everything else solved along."""
    bright = solution.model.picture(solution.fit.values[: len(solution.model.bases)]) * (1 + solution.fit.gain)
    along_y, along_x = np.gradient(bright)
    xy, xx = np.gradient(along_x)
    yy = np.gradient(along_y, axis=0)
    columns = np.stack([(xx - yy) / 4, xy / 2]).astype(np.float32)
    n = len(columns)
    problem = solution.problem.extended(columns, np.zeros(n))

    fit = solve_linear(problem, solution.fit.weight)
    return SecondMoment(fit.values[:n], fit.covariance[:n, :n])


def blurred_start(solution: Solution, settings: SmearSettings) -> State | None:
    """Where to start again when the solution's residuals show a PSF of another kind: a trail, or wings that hold more
    light than scattered light does. None when the Gaussian stands. All pixels are the solution's."""
    state, model = solution.state, solution.model
    bases = len(model.bases)
    shares = np.clip(solution.fit.values[bases : bases + len(model.wings_px)], 0, 1)
    variance = state.psf_sigma_px**2
    if shares.sum() > settings.wings_share:
        variance += float(shares @ np.square(model.wings_px))
    moment = uneven_moment(solution)
    length = float(np.hypot(*moment.trail_px))
    trail = moment.trail_px
    if moment.significance < settings.significance or length < settings.least_px:
        trail = (0.0, 0.0)
    else:
        # The round PSF that was fitted has taken up half of what the trail spreads.
        variance = max(variance - length**2 / 24, (state.psf_sigma_px / 2) ** 2)
    if trail == (0.0, 0.0) and variance == state.psf_sigma_px**2:
        return None
    return replace(state, psf_sigma_px=float(np.sqrt(variance)), trail_px=trail)
