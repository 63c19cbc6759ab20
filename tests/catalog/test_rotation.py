"""Rotation vectors and matrices, against SciPy's."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from catalog.rotation import rotation_from_vector_deg, vector_deg_from_rotation

component = st.floats(-1, 1)


@given(st.tuples(component, component, component), st.floats(-9, 2.25))
@example((0.0, 0.0, 0.0), 0.0)
@example((1.0, 0.0, 0.0), 2.255272505103306)
def test_a_vector_becomes_scipys_matrix_and_comes_back(axis: tuple[float, ...], power: float) -> None:
    length = max(float(np.linalg.norm(axis)), 1e-12)
    vector = np.array(axis) / length * min(10**power, 179.9999) * (length > 1e-12)
    matrix = Rotation.from_rotvec(np.radians(vector)).as_matrix()
    assert rotation_from_vector_deg(vector) == pytest.approx(matrix, abs=1e-14)
    assert vector_deg_from_rotation(matrix) == pytest.approx(vector, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("axis", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (1, -2, 3)])
def test_half_a_turn_has_one_of_the_two_vectors(axis: tuple[int, ...]) -> None:
    vector = 180 * np.array(axis) / np.linalg.norm(axis)
    matrix = rotation_from_vector_deg(vector)
    found = vector_deg_from_rotation(matrix)
    assert np.linalg.norm(found) == pytest.approx(180)
    assert rotation_from_vector_deg(found) == pytest.approx(matrix, abs=1e-12)
