"""Phase functions: what was planted in a store's images comes back from its cubes, within the stated uncertainty."""

from dataclasses import replace

import numpy as np
import pytest

from catalog.errors import FailedError, RefusedError
from catalog.observation import Quality
from tasks.export.pixels import Selection
from tasks.export.source import read_source
from tasks.photometry.each_image import limb_weights
from tasks.photometry.fit import FitSettings, PhotometricFit, fit_law
from tasks.photometry.laws import find_law
from tasks.photometry.region import RegionPixels, region_pixels, sky_level, usable_products

REGION = Selection(latitude_deg=(-50, 50), max_incidence_deg=75, max_emission_deg=75)
only_lunar_lambert = pytest.mark.parametrize("planted", ["lunar-lambert"], indirect=True)


@pytest.fixture(scope="module")
def pixels(planted) -> RegionPixels:
    return region_pixels(usable_products(planted[0]), REGION)


@pytest.fixture(scope="module")
def fit(planted, pixels) -> PhotometricFit:
    scale = planted[1].units_per_if
    return fit_law(find_law(planted[1].law), pixels, FitSettings(units_per_if=scale))


def test_the_planted_parameters_come_back_within_three_sigma(planted, fit) -> None:
    truth = planted[1].parameters
    print(f"\n{planted[1].law}: planted, found, 1-sigma")
    for name in fit.names:
        print(f"  {name:20} {truth[name]:10.4f} {fit.values[name]:10.4f} {fit.sigma[name]:8.4f}")
    assert fit.at_bound == ()
    for name in fit.names:
        assert abs(fit.values[name] - truth[name]) < 3 * fit.sigma[name], name
    useful = {"w": 0.02, "theta_deg": 2.0, "limb_weight": 0.05, "limb_weight_per_deg": 0.001, "mag_per_deg": 0.002}
    assert all(fit.sigma[name] < useful[name] for name in set(useful) & set(fit.names))


def test_calibration_factors_are_found_as_far_as_a_common_one(planted, fit, pixels) -> None:
    truth = np.array([planted[1].calibration[product] for product in pixels.products])
    assert np.all(np.abs(fit.calibration - truth) < 3.5 * np.hypot(fit.calibration_sigma, 0.01))


def test_residuals_are_what_was_planted_and_nothing_more(fit, pixels) -> None:
    assert np.all(fit.rms < 0.09)  # 4 % of unknown markings, 1 % of the brightest pixel's noise
    assert abs(np.median(fit.residual)) < 0.01


@only_lunar_lambert
def test_each_image_alone_tells_the_same_limb_weight(planted, pixels) -> None:
    given = planted[1].parameters
    for image, weight in enumerate(limb_weights(pixels)):
        truth = given["limb_weight"] + given["limb_weight_per_deg"] * pixels.mean_phase_deg(image)
        assert abs(weight.value - truth) < 4 * weight.sigma


@only_lunar_lambert
def test_bootstrap_and_covariance_agree_about_the_shape(planted, pixels, fit) -> None:
    drawn = fit_law(find_law("lunar-lambert"), pixels, FitSettings(bootstrap=40))
    assert {name: drawn.values[name] for name in fit.names} == {name: fit.values[name] for name in fit.names}
    for name in fit.names:
        assert 0.5 < drawn.sigma[name] / fit.sigma[name] < 2.0, name


def test_images_of_one_phase_hold_what_only_phases_tell(planted, pixels) -> None:
    law = find_law(planted[1].law)
    one = pixels.image == 1
    columns = {
        name: getattr(pixels, name)[one] for name in ("value", "mu0", "mu", "phase_deg", "albedo", "tile", "noise")
    }
    only = replace(
        pixels, products=pixels.products[1:2], image=np.zeros(one.sum(), np.intp), seen=pixels.seen[1:2], **columns
    )
    found = fit_law(law, only, FitSettings(units_per_if=planted[1].units_per_if))
    assert {p.name for p in law.parameters if p.needs_phases} <= set(found.held)
    assert not set(found.held) & set(found.names)


def test_flagged_pixels_and_steep_angles_are_left_out(planted, pixels) -> None:
    source = read_source(planted[0] / pixels.products[0])
    quality, angle = source.cube["quality"].values, source.cube["incidence"].values
    banned = np.uint16(Quality.MISSING | Quality.OFF_BODY | Quality.NIGHT_SIDE | Quality.LIMB)
    usable = ((quality & banned) == 0) & (angle <= 75) & (source.cube["emission"].values <= 75)
    usable &= np.abs(source.cube["latitude"].values) <= 50
    assert pixels.seen[0] == usable.sum()


def test_the_sky_is_subtracted(planted, pixels) -> None:
    source = read_source(planted[0] / pixels.products[0])
    before = sky_level(source)
    source.cube["image"].values += np.float32(100)
    assert sky_level(source) == pytest.approx(before + 100, abs=0.1)


def test_a_region_that_nobody_sees_is_refused_with_a_remedy(planted) -> None:
    nowhere = replace(REGION, latitude_deg=(89.9, 90), max_emission_deg=10)
    with pytest.raises(RefusedError, match="Widen the region"):
        region_pixels(usable_products(planted[0]), nowhere)


def test_unknown_names_are_refused(planted, pixels) -> None:
    with pytest.raises(RefusedError, match="lunar-lambert, mcewen"):
        find_law("oren-nayar")
    with pytest.raises(RefusedError, match="has no zeal"):
        fit_law(find_law(planted[1].law), pixels, FitSettings(held={"zeal": 1.0}))


def test_a_region_without_light_fails_by_name(planted, pixels) -> None:
    with pytest.raises(FailedError, match="shows no light"):
        fit_law(find_law(planted[1].law), replace(pixels, value=-pixels.value))
