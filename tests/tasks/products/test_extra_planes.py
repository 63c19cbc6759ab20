"""planes.zarr beside a cube: same pixels, sound checksums, exchanged as a whole."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from small_product import small_publication

from catalog.errors import RefusedError
from tasks.project.more_planes import MORE_PLANES, PARTS, SIGMA_PARTS
from tasks.project.uncertainty import PoseUncertainty
from tasks.publish import publish
from tasks.publish.checksums import checksum_faults
from tasks.publish.extra_planes import as_float32, write_extra_planes


@pytest.fixture(scope="module")
def product(tmp_path_factory):
    return publish(small_publication(size=64, radius_px=24.0), tmp_path_factory.mktemp("store"))


def test_added_planes_go_with_the_cube(product):
    written = write_extra_planes(product)
    assert checksum_faults(product) == []
    with xr.open_zarr(written) as extra, xr.open_zarr(product / "cube.zarr") as cube:
        both = xr.merge([extra.load(), cube.load()], join="exact", combine_attrs="override")
    on_body = np.isfinite(both.latitude.values)
    assert set(MORE_PLANES) <= set(both.variables)
    assert np.isfinite(both.right_ascension.values).all()
    assert np.array_equal(np.isfinite(both.limb_distance_km.values), ~on_body)
    assert np.array_equal(both.shadow.values[on_body] == 1, both.incidence.values[on_body] >= 90)
    west = (both.longitude_west + both.longitude).values[on_body] % 360
    assert np.minimum(west, 360 - west).max() < 1e-4
    for name, plane in MORE_PLANES.items():
        values = both[name].values[np.isfinite(both[name].values)]
        low, high = plane.valid_range
        assert low <= values.min() <= values.max() <= high, name


def test_the_parts_of_the_uncertainty_add_up_to_the_cubes(tmp_path):
    """In squares; and where nobody knows a part, or the whole, it is unknown."""
    sigmas = {"offset_px": [0.1, 0.2], "range_factor": 1e-4, "roll_deg": 0.2, "attitude_deg": [0.2, 0.2, 0.3]}
    known = replace(PoseUncertainty.from_sigmas(sigmas), map_frame_deg=0.14)
    place = np.full((64, 64), 0.3, np.float32)
    publication = small_publication(size=64, radius_px=24.0, uncertainty=known, distortion_uncertainty_px=place)
    written = write_extra_planes(publish(publication, tmp_path), tuple(SIGMA_PARTS))
    with xr.open_zarr(written) as extra, xr.open_zarr(written.parent / "cube.zarr") as cube:
        on_body = np.isfinite(cube.latitude.values)
        for coordinate in ("latitude", "longitude"):
            parts = [extra[f"{coordinate}_uncertainty_{part}"].values for part in PARTS]
            assert all(np.array_equal(np.isfinite(part), on_body) for part in parts)
            whole = cube[f"{coordinate}_uncertainty"].values
            inside = on_body & (whole < 10)
            assert np.abs(np.sqrt(sum(part**2 for part in parts)) / whole - 1)[inside].max() < 2e-3
    unknown = small_publication("C0002", size=64, radius_px=24.0, uncertainty=PoseUncertainty.from_sigmas({}))
    with xr.open_zarr(write_extra_planes(publish(unknown, tmp_path), tuple(SIGMA_PARTS))) as extra:
        assert not np.isfinite(extra.to_array().values).any()


def test_other_planes_replace_them_and_nothing_is_left_behind(product):
    write_extra_planes(product)
    written = write_extra_planes(product, ("shadow",))
    assert checksum_faults(product) == []
    with xr.open_zarr(written) as extra:
        assert set(extra.data_vars) == {"shadow"}


def test_a_folder_without_a_cube_is_refused(tmp_path):
    with pytest.raises(RefusedError, match=r"holds no cube\.zarr"):
        write_extra_planes(tmp_path)


def test_a_full_turn_is_zero():
    assert as_float32("sun_azimuth", np.array([[359.99999999, 1.0]])).tolist() == [[0.0, 1.0]]
