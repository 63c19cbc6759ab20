"""A loop stands still where it goes to and fro; one that leads somewhere, or far, does not."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tasks.rest import REST_PX, rest_of


def lengths(*values: float) -> list[tuple[float, float]]:
    return [(0.8 * value, 0.6 * value) for value in values]


@pytest.mark.parametrize(
    "moves",
    [
        lengths(0.027, *[0.021, -0.021] * 4),
        lengths(5.0, -0.3, *[0.08, -0.08] * 3),
        [(0.03, 0.0), (0.0, 0.03), (-0.03, 0.0), (0.0, -0.03)],
        lengths(*[0.02, 0.02, 0.02, 0.02, -0.08] * 2),
    ],
    ids=["to and fro", "after an approach", "round a square", "a creep that snaps back"],
)
def test_it_stands_still(moves: list[tuple[float, float]]) -> None:
    rest = rest_of(moves, REST_PX)
    assert rest is not None
    assert 0 < np.hypot(*rest.scatter) <= REST_PX
    assert np.hypot(*rest.back) <= REST_PX


@pytest.mark.parametrize(
    "moves",
    [
        lengths(*[0.03] * 12),
        lengths(*(0.05 * 0.9**n for n in range(12))),
        lengths(*(0.05 * (-0.4) ** n for n in range(12))),
        lengths(*[0.5, -0.5] * 6),
        lengths(*(0.03 * (-1.5) ** n for n in range(12))),
        lengths(*(0.03 * 1.5**n for n in range(12))),
        [(float("nan"), 0.0)] * 12,
        lengths(0.03, -0.03),
    ],
    ids=[
        "drifts",
        "approaches slowly",
        "still converges",
        "swings far",
        "swings farther",
        "runs away",
        "NaN",
        "two",
    ],
)
def test_it_does_not_stand_still(moves: list[tuple[float, float]]) -> None:
    assert all(rest_of(moves[:count], REST_PX) is None for count in range(len(moves) + 1))


@given(
    st.lists(st.tuples(st.floats(-0.03, 0.03), st.floats(-0.03, 0.03)), min_size=9, max_size=14),
    st.floats(-50, 50),
)
def test_places_that_only_scatter_are_at_rest_near_their_middle(
    places: list[tuple[float, float]], start: float
) -> None:
    """The middle is that of the places looked at, wherever the loop came from."""
    way = np.array([(start, 0.0), *places])
    rest = rest_of(list(np.diff(way, axis=0)), REST_PX)
    if rest is not None:
        np.testing.assert_array_less(np.abs(way[-1] + rest.back), 0.03 + 1e-9)
        assert np.all(rest.scatter <= 0.06)
