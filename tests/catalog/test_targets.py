"""The catalog's targets: names, and rotation models that reproduce SPICE's."""

from pathlib import Path

import numpy as np
import pytest

from catalog.errors import RefusedError
from catalog.target import Target, find_target, known_targets

SECONDS_PER_YEAR = 365.25 * 86400.0
MEASURED_SINCE_PCK00010 = {"pluto", "charon"}

real = pytest.mark.real


def test_the_papers_moons_enceladus_and_pluto_are_in_the_catalog_with_their_maps() -> None:
    for name in ("io", "europa", "ganymede", "callisto", "enceladus", "pluto"):
        assert find_target(name).basemap


@pytest.mark.parametrize("spelling", ["Europa", " EUROPA ", "502"])
def test_a_target_is_found_by_any_spelling(spelling: str) -> None:
    assert find_target(spelling).name == "europa"


@pytest.mark.parametrize("name", sorted(known_targets()))
def test_target_crs_is_known_to_pyproj_and_belongs_to_the_body(name: str) -> None:
    import pyproj

    target = known_targets()[name]
    assert target.iau_crs is not None
    assert pyproj.CRS(target.iau_crs).name.lower().startswith(name)


def test_an_unknown_target_is_refused_with_what_is_known() -> None:
    with pytest.raises(RefusedError, match=r"'vulcan'.*callisto.*no PCK is loaded"):
        find_target("vulcan")


@real
@pytest.mark.parametrize("name", sorted(known_targets()))
def test_rotation_model_equals_spice_over_a_century(name: str, data_folder: Path) -> None:
    import spiceypy

    from catalog.spice import kernel_pool

    target = known_targets()[name]
    assert target.rotation is not None
    times = np.random.default_rng(target.naif_id).uniform(-50, 50, 20) * SECONDS_PER_YEAR
    with kernel_pool([data_folder / "kernels" / "pck"]):
        spice = [spiceypy.pxform("J2000", target.body_frame, et) for et in times]
        radii = spiceypy.bodvcd(target.naif_id, "RADII", 3)[1]
    ours = [target.rotation.body_from_j2000(et) for et in times]
    np.testing.assert_allclose(ours, spice, atol=1e-10)
    np.testing.assert_allclose(target.radii_km, radii, rtol=0.006 if name in MEASURED_SINCE_PCK00010 else 1e-12)


@real
def test_a_body_outside_the_catalog_comes_from_the_loaded_pck(data_folder: Path) -> None:
    import spiceypy

    from catalog.spice import kernel_pool

    pck = data_folder / "kernels" / "pck"
    amalthea = find_target("Amalthea", [pck])
    assert amalthea.naif_id == 505
    assert amalthea.radii_km == (125.0, 73.0, 64.0)
    assert amalthea.rotation is not None
    with kernel_pool([pck]):
        spice = spiceypy.pxform("J2000", amalthea.body_frame, 1e8)
    np.testing.assert_allclose(amalthea.rotation.body_from_j2000(1e8), spice, atol=1e-10)


@real
def test_a_name_that_no_pck_knows_is_refused_with_the_nearest_of_its_bodies(data_folder: Path) -> None:
    with pytest.raises(RefusedError, match=r"'amaltea'.*Did you mean amalthea"):
        find_target("amaltea", [data_folder / "kernels"])


@pytest.mark.parametrize(
    ("radius_km", "told_km", "relief_km"),
    [
        (10.0, None, 0.35),
        (150.0, None, 5.25),
        (250.0, None, 1.4),
        (900.0, None, 1.4),
        (1800.0, None, 0.0),
        (10.0, 0.1, 0.1),
    ],
)
def test_relief_is_as_told_or_that_of_bodies_of_its_size(
    radius_km: float, told_km: float | None, relief_km: float
) -> None:
    body = Target(name="body", naif_id=1, radii_km=(radius_km,) * 3, relief_km=told_km)
    assert body.expected_relief_km == pytest.approx(relief_km)


def test_a_shape_model_has_its_relief_in_it() -> None:
    assert Target(name="body", naif_id=1, radii_km=(10.0,) * 3, shape="body.obj").expected_relief_km == 0
