"""What the command `stars` is given: refused before any image is looked at; and why a frame has too few stars."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from catalog.camera import Camera
from catalog.errors import RefusedError, WrongOptionError
from catalog.observation import Observation, Quality
from catalog.stars.observer import Observer
from lab.stars.sky import made_up_sky
from tasks.stars.field import find_stars, saturated_spots
from tasks.stars.requests import requests_of
from tasks.stars.settings import StarSettings
from tasks.undistort import UndistortSettings

NOTHING = dict.fromkeys(("near", "camera", "pose_file", "mask", "flip", "plane", "epoch", "summing"))
CAMERA = Camera(name="toy", size_px=(160, 120), centre_px=(79.5, 59.5), focal_length_px=5000.0, psf_sigma_px=1.0)


def options(**given: Any) -> dict[str, Any]:
    return {**NOTHING, "catalog": "gaia", "columns": (), "cone_deg": 10.0, "files": (Path("a.img"),), **given}


def test_a_request_is_made_for_each_file(tmp_path: Path) -> None:
    own = tmp_path / "own.csv"
    own.write_text("ra,dec,mag\n1,2,3\n")
    files = (Path("a.img"), Path("b.img"))
    assert [each.image for each in requests_of(options(files=files, catalog=str(own), near="io"), ())] == list(files)
    assert len(list(requests_of(options(near="10.5,-3"), ()))) == 1


@pytest.mark.parametrize("near", ["nowhere", "10,95", "10,x"])
def test_a_place_that_nobody_knows_is_a_wrong_option(near: str) -> None:
    with pytest.raises(WrongOptionError, match=near):
        requests_of(options(near=near), ())


@pytest.mark.parametrize("columns", [("ra_deg=nothing",), ("ra_deg=mag",)])
def test_a_catalog_that_is_none_is_refused_before_any_image(tmp_path: Path, columns: tuple[str, ...]) -> None:
    own = tmp_path / "own.csv"
    own.write_text("ra,dec,mag\n1,2,3\n")
    with pytest.raises(RefusedError, match=r"own\.csv"):
        requests_of(options(catalog=str(own), columns=columns), ())
    with pytest.raises(RefusedError, match="does not exist"):
        requests_of(options(catalog=str(tmp_path / "none.csv")), ())


def test_saturated_stars_are_named_where_too_few_stand_out() -> None:
    quality = np.zeros((120, 160), np.uint16)
    for x, y in ((20, 30), (60, 90), (140, 40)):
        quality[y : y + 3, x : x + 4] |= np.uint16(Quality.SATURATED)
    picture = np.random.default_rng(1).normal(10, 2, quality.shape).astype(np.float32)
    frame = Observation(picture, np.full(quality.shape, 2, np.float32), quality)
    sky = made_up_sky(np.array([0.0, 0.0, 1.0]), 2.0, 10.0, np.random.default_rng(2))
    found = find_stars(frame, CAMERA, sky, Observer(None, None), [], StarSettings(), UndistortSettings())
    assert saturated_spots(frame) == 3
    assert found.lock is None
    assert "3 saturated spots are not measured" in str(found.reason)
