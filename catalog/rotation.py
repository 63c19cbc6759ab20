"""Rotations, named `a_from_b`: v_a = a_from_b @ v_b. Right-handed 3x3 matrices."""

import math

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
    x, y, z = (math.radians(float(each)) for each in np.asarray(vector_deg, dtype=np.float64))
    angle = math.sqrt(x * x + y * y + z * z)
    # Unit quaternion; the sine's own series where the angle cannot be divided by.
    half = 0.5 * angle
    sine = math.sin(half) / angle if angle > 1e-8 else 0.5 - angle * angle / 48
    w, x, y, z = math.cos(half), x * sine, y * sine, z * sine
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def vector_deg_from_rotation(matrix: ArrayLike) -> NDArray[np.float64]:
    """Rotation vector (3,), degrees, of a rotation matrix (3, 3), by its quaternion (Shepperd 1978, J. Guidance and
    Control 1, 223: the largest component first, so that nothing small is divided by)."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = np.asarray(matrix, dtype=np.float64).tolist()
    trace = xx + yy + zz
    largest = max(trace, xx, yy, zz)
    if largest == trace:
        w, x, y, z = 1 + trace, zy - yz, xz - zx, yx - xy
    elif largest == xx:
        w, x, y, z = zy - yz, 1 + 2 * xx - trace, xy + yx, xz + zx
    elif largest == yy:
        w, x, y, z = xz - zx, xy + yx, 1 + 2 * yy - trace, yz + zy
    else:
        w, x, y, z = yx - xy, xz + zx, yz + zy, 1 + 2 * zz - trace
    if w < 0:
        w, x, y, z = -w, -x, -y, -z
    length = math.sqrt(x * x + y * y + z * z)
    angle_by_length = 2 * math.atan2(length, w) / length if length > 0 else 0.0
    return np.degrees(np.array([x, y, z]) * angle_by_length)
