"""Two-variable Legendre polynomials on a normalised frame: the well-conditioned form of the paper's equation 4."""

import numpy as np
from numpy.polynomial.legendre import legvander
from numpy.typing import NDArray


def terms_of_degree(degree: int) -> int:
    """Number of products P_i(x) P_j(y) with i + j <= degree."""
    return (degree + 1) * (degree + 2) // 2


def legendre_matrix(xy: NDArray[np.float64], degree: int, size_px: tuple[int, int]) -> NDArray[np.float64]:
    """Design matrix (n, terms) of all products of total degree <= `degree` at pixels (n, 2), the frame of `size_px`
    being mapped to [-1, 1]."""
    half = (np.asarray(size_px, dtype=np.float64) - 1.0) / 2.0
    x, y = ((xy - half) / half).T
    in_x, in_y = legvander(x, degree), legvander(y, degree)
    return np.concatenate([in_x[:, i : i + 1] * in_y[:, : degree + 1 - i] for i in range(degree + 1)], axis=1)
