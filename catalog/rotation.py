"""Rotations, named `a_from_b`: v_a = a_from_b @ v_b. Right-handed 3x3 matrices."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

ORTHONORMAL_TOLERANCE = 1e-9


def checked_rotation(matrix: ArrayLike, name: str) -> NDArray[np.float64]:
    """Return `matrix` as float64 (3, 3) after checking that it is a right-handed rotation.

    Raises ValueError naming the matrix when it is not 3x3, not finite, not orthonormal to 1e-9, or mirrors (det -1).
    """
    m = np.array(matrix, dtype=np.float64)
    if m.shape != (3, 3):
        raise ValueError(f"{name} must be a 3x3 matrix, got shape {m.shape}")
    if not np.isfinite(m).all():
        raise ValueError(f"{name} holds values that are not finite")
    departure = float(np.abs(m @ m.T - np.eye(3)).max())
    if departure > ORTHONORMAL_TOLERANCE:
        raise ValueError(
            f"{name} is not orthonormal: it departs by {departure:.2g}, allowed {ORTHONORMAL_TOLERANCE:g} "
            "(write more digits, or take the nearest rotation: U V^T of its singular value decomposition)"
        )
    if np.linalg.det(m) < 0:
        raise ValueError(f"{name} is left-handed (determinant -1): check the order and sign of its axes")
    m.setflags(write=False)
    return m


def nearest_rotation(matrix: ArrayLike) -> NDArray[np.float64]:
    """Closest right-handed rotation to `matrix` (3, 3) in the Frobenius norm; for matrices printed with few digits."""
    u, _, vt = np.linalg.svd(np.asarray(matrix, dtype=np.float64))
    u[:, -1] *= np.sign(np.linalg.det(u @ vt))
    return u @ vt


def rotation_from_vector_deg(vector_deg: ArrayLike) -> NDArray[np.float64]:
    """Rotation matrix (3, 3) that turns vectors by |vector| degrees about `vector` (3,)."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_rotvec(np.radians(vector_deg)).as_matrix()


def vector_deg_from_rotation(matrix: ArrayLike) -> NDArray[np.float64]:
    """Rotation vector (3,), degrees, of a rotation matrix (3, 3)."""
    from scipy.spatial.transform import Rotation

    return np.degrees(Rotation.from_matrix(matrix).as_rotvec())
