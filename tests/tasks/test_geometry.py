"""Geometry that several steps share: lines of sight against the unit sphere, values between a map's pixels."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import RegularGridInterpolator

from tasks.compiled import _files_called, _forget_older
from tasks.geometry.bilinear import bilinear, map_values, values_towards
from tasks.geometry.unit_sphere import closest_approach, first_hits
from tasks.project.kernel import fill_rows

ROOT = Path(__file__).parents[2]
side = st.floats(-1.5, 1.5)


@given(side, side, st.floats(3.0, 1e5))
def test_a_line_meets_the_sphere_on_the_near_side_or_not_at_all(x: float, y: float, away: float) -> None:
    """Lines along z through (x, y): the root is known."""
    anchor, backward = np.array([[x, y, 0.0]]), np.array([[0.0, 0.0, away]])
    (found,) = first_hits(anchor, backward, np.array([x, y, away]))
    if x * x + y * y > 1:
        assert np.isnan(found).all()
    elif x * x + y * y < 1 - 1e-12:
        assert found == pytest.approx([x, y, np.sqrt(1 - x * x - y * y)], abs=1e-12)


def test_a_sphere_behind_the_start_is_not_seen() -> None:
    assert np.isnan(
        first_hits(np.array([[0.0, 0.0, 0.0]]), np.array([[0.0, 0.0, 2.0]]), np.array([0.0, 0.0, -2.0]))
    ).all()


@given(st.tuples(*[st.floats(-3, 3)] * 3), st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda b: np.dot(b, b) > 1e-3))
def test_the_closest_point_lies_on_the_line_and_square_to_it(
    a: tuple[float, float, float], b: tuple[float, float, float]
) -> None:
    *point, half_chord2, length2 = closest_approach(*a, *b)
    assert np.dot(point, b) == pytest.approx(0, abs=1e-9)
    assert np.cross(np.subtract(point, a), b) == pytest.approx(np.zeros(3), abs=1e-9)
    assert (half_chord2, length2) == pytest.approx((1 - np.dot(point, point), np.dot(b, b)))


@given(st.floats(-90, 90), st.floats(-720, 720), st.sampled_from([0.0, -180.0, 37.5]))
def test_a_value_between_pixels_is_scipys(latitude: float, longitude: float, left_edge: float) -> None:
    albedo = np.random.default_rng(5).uniform(0, 1, (18, 36)).astype(np.float32)
    rows, columns = np.arange(18), np.arange(-1, 37)
    wrapped = np.concatenate([albedo[:, -1:], albedo, albedo[:, :1]], axis=1).astype(np.float64)
    expected = RegularGridInterpolator((rows, columns), wrapped)
    row, column = np.clip((90 - latitude) / 10 - 0.5, 0, 17), ((longitude - left_edge) % 360.0) / 10 - 0.5
    found = map_values(albedo, left_edge, np.array([latitude]), np.array([longitude]))
    assert found == pytest.approx(np.ravel(expected((float(row), float(column)))), abs=1e-6)


@pytest.mark.parametrize("left_edge", [0.0, 179.886, -90.0])
def test_a_direction_is_its_latitude_and_longitude(left_edge: float) -> None:
    rng = np.random.default_rng(5)
    albedo, directions = rng.random((40, 80)).astype(np.float32), rng.normal(size=(400, 3))
    directions[:2] = (0, 0, 1), (0, 0, -3)
    x, y, z = (directions / np.linalg.norm(directions, axis=1, keepdims=True)).T
    expected = map_values(albedo, left_edge, np.degrees(np.arcsin(z)), np.degrees(np.arctan2(y, x)))
    assert values_towards(albedo, left_edge, directions) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(("x", "expected"), [(-0.5, 2.0), (3.5, 2.0), (4.0, 1.0), (-1.0, 3.0), (0.5, 1.5)])
def test_columns_go_round(x: float, expected: float) -> None:
    assert bilinear(np.array([[1, 2, 3, 3], [1, 2, 3, 3]], np.float32), x, 0.0) == pytest.approx(expected)


def test_machine_code_older_than_a_file_that_it_calls_is_forgotten(tmp_path: Path) -> None:
    """numba looks at a function's own file; the projection's loop calls functions of another."""
    called = _files_called(fill_rows.py_func, set())
    assert {path.name for path in called} >= {"kernel.py", "unit_sphere.py"}
    old, new, other = (
        tmp_path / name for name in ("kernel.fill_rows-1.nbi", "kernel.fill_rows-1.1.nbc", "kernel.x.nbi")
    )
    for path in (old, new, other):
        path.write_text("")
    os.utime(old, (0, 0))
    _forget_older(tmp_path, fill_rows.py_func)
    assert (old.exists(), new.exists(), other.exists()) == (False, True, True)


def test_numba_is_imported_when_a_compiled_function_is_first_called() -> None:
    code = (
        "import sys; import tasks.registry; import numpy as np; from tasks.geometry import bilinear as room\n"
        "before = 'numba' in sys.modules\n"
        "value = room.bilinear(np.ones((2, 4), np.float32), 0.5, 0.5)\n"
        "print(before, value, 'numba' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "1.0", "True"]
