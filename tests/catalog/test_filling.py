"""Filled lines, columns and stretches are missing; a sky that is exactly zero is not."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tifffile
from astropy.io import fits
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from PIL import Image

from catalog.observation import Quality
from catalog.readers import read_frame
from catalog.readers.filling import filled

N = 200
Y, X = np.mgrid[:N, :N]


def disk(sky: float, noise: float, seed: int = 0, radius: float = 60.0, centre: tuple[float, float] = (90, 110)) -> Any:
    """A shaded, textured disk on a sky, with noise everywhere (0: none at all)."""
    rng = np.random.default_rng(seed)
    distance = np.hypot(X - centre[0], Y - centre[1])
    shade = np.clip((radius - distance + 0.5), 0, 1) * (80 + 40 * np.sin(X / 9 + 0.7) * np.cos(Y / 7) + X / 4)
    return sky + shade + (rng.normal(0, noise, (N, N)) if noise else 0.0)


def as_float(image: NDArray[Any]) -> NDArray[Any]:
    return image.astype(np.float32)


def as_bytes(image: NDArray[Any]) -> NDArray[Any]:
    return np.clip(np.round(image), 0, 255).astype(np.uint8)


def as_words(image: NDArray[Any]) -> NDArray[Any]:
    return np.clip(np.round(image * 50), 0, 65535).astype(np.uint16)


KINDS = [as_float, as_bytes, as_words]


def lost(*places: tuple[slice | int, slice | int]) -> NDArray[np.bool_]:
    mask = np.zeros((N, N), bool)
    for place in places:
        mask[place] = True
    return mask


ALL = slice(None)
RAGGED = lost(*((70 + i, slice(40 + 37 * i % 100, None)) for i in range(8)))
LOST = {
    "lines in the disk": lost((slice(80, 95), ALL)),
    "the last lines": lost((slice(150, None), ALL)),
    "the first line": lost((0, ALL)),
    "every other line": lost((slice(60, 140, 2), ALL)),
    "lines in the sky": lost((slice(10, 20), ALL)),
    "the end of a line": lost((100, slice(80, None))),
    "the beginning of lines": lost((100, slice(None, 120)), (130, slice(None, 60))),
    "ends of lines below each other": RAGGED,
    "a block in the disk": lost((slice(90, 120), slice(70, 110))),
    "a block at the edge": lost((slice(90, 120), slice(150, None))),
    "a column": lost((ALL, 77)),
    "the last columns": lost((ALL, slice(180, None))),
    "a line and an end": lost((80, ALL), (81, slice(100, None))),
}


@pytest.mark.parametrize("mask", LOST.values(), ids=LOST.keys())
@pytest.mark.parametrize("kind", KINDS)
def test_filling_in_a_noisy_image_is_found_whole_and_nothing_else(
    kind: Callable[[NDArray[Any]], NDArray[Any]], mask: NDArray[np.bool_]
) -> None:
    image = kind(disk(sky=12.0, noise=2.5))
    image[mask] = 0
    found = filled(image)
    assert np.array_equal(found.mask, mask)
    assert f"{mask.sum()} pixels" in found.sentences[0]
    assert "the value 0" in found.sentences[0]


@pytest.mark.parametrize("value", [-32768.0, 7.25, 1e6])
def test_whole_lines_of_any_value(value: float) -> None:
    image = as_float(disk(12.0, 2.5))
    image[50:60] = image[190:] = value
    assert np.array_equal(filled(image).mask, lost((slice(50, 60), ALL), (slice(190, None), ALL)))


@pytest.mark.parametrize("value", [-32768.0, 7.25, 65535.0])
@pytest.mark.parametrize("name", ["a block in the disk", "the end of a line", "ends of lines below each other"])
def test_parts_of_lines_of_any_value(name: str, value: float) -> None:
    image = as_float(disk(12.0, 2.5))
    image[LOST[name]] = value
    assert np.array_equal(filled(image).mask, LOST[name])


def test_blocks_of_lines_of_two_values_beside_each_other() -> None:
    image = as_float(disk(12.0, 2.5))
    image[:100], image[100:110], image[150:160], image[160:] = -1.0, 7.0, 7.0, -1.0
    assert np.array_equal(filled(image).mask, lost((slice(110), ALL), (slice(150, None), ALL)))


def test_a_saturated_disk_of_floats_is_no_filling() -> None:
    assert not filled(np.minimum(as_float(disk(12, 2.5)), np.float32(60))).mask.any()


def test_a_sky_about_zero_is_noise_too() -> None:
    image = as_float(disk(0.0, 2.5))
    image[30:33] = 0
    assert np.array_equal(filled(image).mask, lost((slice(30, 33), ALL)))


@given(st.integers(0, 400), st.integers(-100, 300), st.integers(-100, 300), st.sampled_from([0.0, 3.0]), st.booleans())
@settings(max_examples=60, deadline=None)
def test_a_sky_of_exactly_one_value_is_no_filling(radius: int, x: int, y: int, noise: float, whole: bool) -> None:
    """As simulated and calibrated images have it; the noise is then only where light falls."""
    clean = disk(0.0, 0.0, radius=float(radius), centre=(x, y))
    image = clean + np.where(clean > 0, np.random.default_rng(1).normal(0, noise, clean.shape) if noise else 0.0, 0.0)
    image = as_bytes(np.abs(image)) if whole else as_float(image)
    assert filled(image).mask.sum() <= 3 * N // 100


@pytest.mark.parametrize("kind", KINDS)
def test_poisson_noise_without_background_is_no_filling(kind: Callable[[NDArray[Any]], NDArray[Any]]) -> None:
    rng = np.random.default_rng(3)
    for background in (0.0, 0.01, 0.3):
        assert not filled(kind(rng.poisson(disk(background, 0.0)).astype(float))).mask.any(), background


def test_smooth_pictures_and_saturated_disks_are_no_filling() -> None:
    assert not filled(as_bytes(Y / 2.0)).mask.any()
    assert not filled(as_bytes(X / 2.0)).mask.any()
    assert not filled(np.full((N, N), 5, np.uint8)).mask.any()
    assert not filled(np.minimum(as_bytes(disk(12, 2.5) * 4), 255)).mask.any()
    assert not filled(np.zeros((5, 5), np.uint8)).mask.any()


def save_fits(path: Path, image: NDArray[Any]) -> Path:
    fits.writeto(path.with_suffix(".fits"), image)
    return path.with_suffix(".fits")


def save_png(path: Path, image: NDArray[Any]) -> Path:
    Image.fromarray(as_words(image)).save(path.with_suffix(".png"))
    return path.with_suffix(".png")


def save_tiff(path: Path, image: NDArray[Any]) -> Path:
    tifffile.imwrite(path.with_suffix(".tif"), image)
    return path.with_suffix(".tif")


@pytest.mark.parametrize("save", [save_fits, save_png, save_tiff])
def test_in_every_format_the_quality_plane_says_so_and_the_user_is_reported(
    save: Callable[[Path, NDArray[Any]], Path], tmp_path: Path
) -> None:
    image = as_float(disk(12.0, 2.5))
    image[LOST["lines in the disk"]] = 0
    frame = read_frame(save(tmp_path / "a", image))
    assert np.array_equal(frame.observation.quality == Quality.MISSING, LOST["lines in the disk"])
    assert any("3000 pixels" in sentence for sentence in frame.warnings)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("outside", [0.0, 255.0])
@pytest.mark.parametrize("part", [(slice(0, 90), slice(0, 120)), (slice(40, N), ALL), (slice(30, 150), slice(20, 160))])
def test_what_lies_outside_a_window_of_a_noisy_image_is_filling(
    kind: Callable[[NDArray[Any]], NDArray[Any]], outside: float, part: tuple[slice, slice]
) -> None:
    """As crops lie in whole frames: an L or a border of one value, beside which the frame is noisy only in part."""
    image = np.full((N, N), outside)
    image[part] = disk(12.0, 2.5)[part]
    expected = np.ones((N, N), bool)
    expected[part] = False
    assert np.array_equal(filled(kind(image)).mask, expected)
