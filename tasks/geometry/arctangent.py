"""The arctangent of two coordinates without branches or calls, so that loops over pixels can be vectorised."""

import math

import numpy as np
from numpy.typing import NDArray

from tasks.compiled import compiled

DEGREES = 180.0 / math.pi
TINY = 1e-290  # keeps 0/0 at the poles and the sub-solar point from becoming NaN
TAN_22_5 = math.sqrt(2.0) - 1.0


def _atan_series() -> tuple[float, ...]:
    """Coefficients of atan(r)/r in powers of r^2, exact to the last bits for |r| <= tan 22.5 deg (Chebyshev fit)."""
    from numpy.polynomial import Chebyshev, Polynomial

    def ratio(r2: NDArray[np.float64]) -> NDArray[np.float64]:
        r = np.sqrt(np.maximum(r2, 1e-300))
        return np.arctan(r) / r

    fit = Chebyshev.interpolate(ratio, 13, domain=[0.0, TAN_22_5**2])
    return tuple(float(c) for c in fit.convert(kind=Polynomial).coef)


A0, A1, A2, A3, A4, A5, A6, A7, A8, A9, A10, A11, A12, A13 = _atan_series()


@compiled
def atan2_deg(y: float, x: float) -> float:
    """atan2 in degrees without branches or calls, to about 1e-14 deg; atan2(0, 0) is 0, NaN stays NaN."""
    ay, ax = abs(y), abs(x)
    steep = ay > ax
    low = ax if steep else ay
    high = (ay if steep else ax) + TINY
    folded = low > TAN_22_5 * high
    r = ((low - high) if folded else low) / ((low + high) if folded else high)
    z = r * r
    s = A13
    s = s * z + A12
    s = s * z + A11
    s = s * z + A10
    s = s * z + A9
    s = s * z + A8
    s = s * z + A7
    s = s * z + A6
    s = s * z + A5
    s = s * z + A4
    s = s * z + A3
    s = s * z + A2
    s = s * z + A1
    s = s * z + A0
    angle = r * s * DEGREES
    angle = (angle + 45.0) if folded else angle
    angle = (90.0 - angle) if steep else angle
    angle = (180.0 - angle) if x < 0.0 else angle
    return -angle if y < 0.0 else angle
