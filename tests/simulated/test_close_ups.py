"""Close-ups by an independent ray caster, of a surface that the map gets wrong: a small part of
`planetpose benchmark closeup`."""

import pytest

from lab.closeup.run import run_close_ups, summary

# Small frames of four cameras, of four bodies.
SEEDS = (2, 3, 17, 18)


@pytest.fixture(scope="module")
def figures() -> dict:
    return summary(run_close_ups(SEEDS, 2, None, lambda _: None))


def test_close_ups_are_matched_to_half_a_pixel_of_the_map(figures: dict) -> None:
    assert figures["frames"] == len(SEEDS)
    assert figures["solved"] >= len(SEEDS) - 1
    assert figures["ok_far_off"] == []


def test_no_wrong_map_and_no_wrong_place_is_ok(figures: dict) -> None:
    assert figures["wrong_maps"] == 2 * len(SEEDS)
    assert figures["wrong_ok"] == figures["wrong_doubtful"] == 0
