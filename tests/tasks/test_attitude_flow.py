"""Optical flow: planted shifts of a texture, whole and fractional, everywhere and in parts."""

import numpy as np
import pytest
from numpy.typing import NDArray

from tasks.attitude.flow import Flow, optical_flow
from tasks.attitude.flow_loop import paraboloid_peak

SHAPE = (150, 160)
EVERYWHERE = np.ones(SHAPE, bool)


def texture(sigma_px: float = 2.0, shape: tuple[int, int] = SHAPE) -> NDArray[np.float32]:
    """Smooth random field with values of order one, the same at opposite edges."""
    from scipy.ndimage import gaussian_filter

    field = gaussian_filter(np.random.default_rng(1).standard_normal(shape), sigma_px, mode="wrap")
    return (field / field.std()).astype(np.float32)


def moved(image: NDArray[np.float32], shift_px: tuple[float, float]) -> NDArray[np.float32]:
    """`image` displaced by (dx, dy), exactly, around the edges."""
    from scipy.ndimage import fourier_shift

    return np.fft.ifft2(fourier_shift(np.fft.fft2(image), shift_px[::-1])).real.astype(np.float32)


@pytest.mark.parametrize("shift_px", [(0, 0), (1, 0), (0, -3), (2, -3), (-3, 3)])
def test_whole_pixel_shifts_are_found_everywhere(shift_px: tuple[int, int]) -> None:
    simulation = texture()
    flow = optical_flow(np.roll(simulation, shift_px[::-1], axis=(0, 1)), simulation, EVERYWHERE)
    assert flow.valid.mean() > 0.7
    assert (np.rint(flow.displacement[flow.valid]) == shift_px).all()
    assert flow.displacement[flow.valid].mean(axis=0) == pytest.approx(shift_px, abs=0.005)
    assert flow.correlation[flow.valid].min() > 0.999


@pytest.mark.parametrize("sigma_px", [1.2, 2.0, 3.0])
@pytest.mark.parametrize("shift_px", [(0.25, 0.0), (0.5, 0.25), (1.5, 2.25), (-2.4, -0.3)])
def test_fractions_of_a_pixel_are_found_without_bias(shift_px: tuple[float, float], sigma_px: float) -> None:
    simulation = texture(sigma_px)
    flow = optical_flow(moved(simulation, shift_px), simulation, EVERYWHERE)
    error = flow.displacement[flow.valid] - np.array(shift_px)
    print(
        f"texture of {sigma_px} px, shift {shift_px}: bias {error.mean(axis=0).round(4)}, scatter {error.std():.3f} px"
    )
    assert np.abs(error.mean(axis=0)).max() < 0.03
    assert error.std() < 0.08


def test_brightness_and_contrast_do_not_matter() -> None:
    simulation = texture()
    image = moved(simulation, (1.3, -0.6))
    flows = [optical_flow(i, simulation, EVERYWHERE) for i in (image, 250 + 40 * image)]
    assert np.abs(flows[0].displacement - flows[1].displacement)[flows[0].valid].max() < 0.01


def test_a_shift_beyond_the_search_is_not_valid_and_unusable_or_bland_places_neither() -> None:
    simulation = texture()
    far = optical_flow(np.roll(simulation, 4, axis=1), simulation, EVERYWHERE)
    assert far.valid.mean() < 0.02
    usable = EVERYWHERE.copy()
    usable[70:75, 80:85] = False
    image = np.where(usable, simulation, np.float32(np.nan))
    flow = optical_flow(image, simulation, usable)
    assert not flow.valid[60:85, 70:95].any()
    assert flow.valid[30:59, 30:69].all()
    simulation[:, 100:] = 0.5
    assert not optical_flow(simulation, simulation, EVERYWHERE).valid[:, 107:].any()


def test_edges_of_the_frame_are_left_out() -> None:
    valid = optical_flow(texture(), texture(), EVERYWHERE).valid
    assert not valid[:10].any()
    assert not valid[:, -10:].any()


@pytest.mark.parametrize("boxes", [(12, 21), (13, 20), (13, 13), (21, 13)])
def test_impossible_boxes_are_refused(boxes: tuple[int, int]) -> None:
    with pytest.raises(ValueError, match="boxes must be odd"):
        optical_flow(texture(), texture(), EVERYWHERE, *boxes)


def test_the_paraboloids_peak_is_exact_for_a_paraboloid() -> None:
    peak = np.array([0.31, -0.42])
    curvature = np.array([[-2.0, 0.9], [0.9, -1.1]])
    steps = np.array([(x, y) for y in (-1, 0, 1) for x in (-1, 0, 1)]) - peak
    scores = np.einsum("ni,ij,nj->n", steps, curvature, steps)[:, None].astype(np.float32)
    assert paraboloid_peak(scores, 0, 4, 3) == pytest.approx(tuple(peak), abs=1e-6)
    assert paraboloid_peak(-scores, 0, 4, 3) == (0, 0)


def by_box_filters(image: NDArray, simulation: NDArray, usable: NDArray, template: int, search: int) -> Flow:
    """The same flow, one displacement after the other, by library functions."""
    from scipy.ndimage import uniform_filter

    def mean(a: NDArray) -> NDArray:
        return uniform_filter(a.astype(np.float64), template, mode="nearest")

    f = np.where(usable, image - image[usable].mean(), 0) / image[usable].std()
    t = (simulation - simulation.mean()) / image[usable].std()
    deviation_t, deviation_f = (np.sqrt(np.maximum(mean(a * a) - mean(a) ** 2, 1e-6)) for a in (t, f))
    reach = (search - template) // 2
    wide_f, wide_mean, wide_deviation = (np.pad(a, reach, mode="edge") for a in (f, mean(f), deviation_f))
    size, (ny, nx) = 2 * reach + 1, t.shape
    scores = np.empty((size, size, ny, nx))
    for i, j in np.ndindex(size, size):
        here = np.s_[i : i + ny, j : j + nx]
        scores[i, j] = (mean(t * wide_f[here]) - mean(t) * wide_mean[here]) / deviation_t / wide_deviation[here]
    best = scores.reshape(size * size, ny, nx).argmax(axis=0)
    row, column = np.divmod(best, size)
    inside = (row % (size - 1) > 0) & (column % (size - 1) > 0)
    places = uniform_filter(usable.astype(np.float64), search, mode="nearest") > 1 - 1e-6
    whole = np.stack([column, row], axis=-1).astype(np.float32) - reach
    return Flow(whole, scores.max(axis=(0, 1)).astype(np.float32), places, places & inside)


@pytest.mark.parametrize("boxes", [(13, 21), (5, 11), (9, 21)])
def test_the_compiled_loop_finds_what_box_filters_find_also_beside_unusable_places(boxes: tuple[int, int]) -> None:
    simulation = texture()
    image = moved(simulation, (1.3, -0.6)) + 0.1 * texture(1.0)[::-1]
    usable = EVERYWHERE.copy()
    usable[70:75, 80:85] = False
    image[~usable] = np.nan
    flow, other = (f(image, simulation, usable, *boxes) for f in (optical_flow, by_box_filters))
    rim = boxes[1] // 2
    middle = np.s_[rim:-rim, rim:-rim]
    np.testing.assert_allclose(flow.correlation[middle], other.correlation[middle], atol=1e-4)
    np.testing.assert_array_equal(flow.valid[middle], other.valid[middle])
    assert 0.5 < flow.valid.mean() < 1
    part = (flow.displacement - other.displacement)[flow.valid]  # the fraction of a pixel, from a paraboloid
    assert np.abs(part).max() <= 1
    assert np.abs(part).mean() < 0.5


def test_a_whole_frame_has_flow_nearly_everywhere() -> None:
    simulation = texture(2.0, (1024, 1024))
    flow = optical_flow(simulation, simulation, np.ones(simulation.shape, bool))
    assert flow.valid.sum() > 0.9 * 1000**2
