"""The benchmark of close-ups: its surfaces, frames and tables."""

import numpy as np
import pytest

from lab.closeup.run import place_error_px, summary
from lab.closeup.scene import OFFSET_PX, close_up
from lab.closeup.surface import catalog_texture, frame_difference_px, true_texture
from lab.closeup.table import markdown


def test_the_frame_of_another_map_is_found_by_tiles() -> None:
    texture = catalog_texture("callisto")
    south, east = frame_difference_px(np.roll(texture, (3, -2), axis=(0, 1)), texture)
    assert (south, east) == (pytest.approx(3, abs=0.1), pytest.approx(-2, abs=0.1))


def test_a_surface_is_not_its_map() -> None:
    texture = catalog_texture("callisto")
    surface = true_texture("callisto", 1, None)
    assert surface.shape == texture.shape
    assert 0.3 < np.corrcoef(surface.ravel(), texture.ravel())[0, 1] < 0.99


@pytest.mark.parametrize("seed", [0, 3, 11])
def test_the_planted_pose_is_off_by_what_was_planted(seed: int) -> None:
    scene = close_up(seed)
    off = place_error_px(scene.true, scene.predicted, scene.camera, scene.target)
    assert OFFSET_PX[0] / 2 < scene.offset_px <= OFFSET_PX[1]
    # Roll and range move the corners besides.
    assert abs(off - scene.offset_px) < 0.03 * max(scene.camera.size_px)


def test_the_table_says_what_is_wrong() -> None:
    found = {"status": "ok", "reason": None, "error_map_px": 2.0, "sigma_map_px": 0.4, "false_alarm": 1e-9}
    base = {"seed": 1, "target": "io", "cpu_s": 1.0}
    rows = [base | found | {"kind": "right"}, base | found | {"kind": "mirrored"}]
    figures = summary(rows)
    assert (figures["ok_far_off"], figures["wrong_ok"], figures["solved"]) == ([1], 1, 0)
    assert "| 1 | 1 | 0 |" in markdown(figures)
