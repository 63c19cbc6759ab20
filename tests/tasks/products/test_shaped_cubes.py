"""Cubes on shape models: the same planes, sound to the checker, shadows among the night side."""

from pathlib import Path

import numpy as np
import pytest
from small_product import EUROPA, pose_of, small_publication

from catalog.observation import Quality
from tasks.project.mesh import mesh_of
from tasks.publish import publish
from tasks.publish.check import product_faults
from tasks.publish.cube import open_cube
from tasks.publish.extra_planes import write_extra_planes


@pytest.fixture(scope="module")
def shaped(tmp_path_factory):
    """Europa as a coarse sphere with a deep notch at the equator."""
    n = 24
    latitude, longitude = np.meshgrid(np.linspace(-90, 90, n + 1), np.arange(2 * n) * 180 / n, indexing="ij")
    lat, lon = np.radians(latitude).ravel(), np.radians(longitude).ravel()
    radius = 1560.0 * (1 - 0.25 * np.exp(-((np.degrees(lat) / 12) ** 2)))
    vertices = radius[:, None] * np.stack([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)], axis=1)
    row, column = np.meshgrid(np.arange(n), np.arange(2 * n), indexing="ij")
    a, b = (row * 2 * n + c % (2 * n) + 1 for c in (column, column + 1))
    faces = np.concatenate([np.stack(f, -1).reshape(-1, 3) for f in ([a, b, b + 2 * n], [a, b + 2 * n, a + 2 * n])])
    path = tmp_path_factory.mktemp("shape") / "europa.obj"
    lines = [f"v {x:.6f} {y:.6f} {z:.6f}\n" for x, y, z in vertices]
    path.write_text("".join([*lines, *(f"f {i} {j} {k}\n" for i, j, k in faces)]))
    return EUROPA.with_shape(path)


def test_a_cube_on_a_shape_model_is_sound(shaped, tmp_path):
    pose = pose_of(24.0).replaced(sun_from_target_km=np.array([7e8, 4e8, -1e8]))
    folder = publish(small_publication(size=64, radius_px=24.0, target=shaped, pose_after=pose), tmp_path)
    write_extra_planes(folder, ("shadow", "local_solar_time"))
    assert product_faults(folder) == []
    with open_cube(folder / "cube.zarr") as cube:
        cube = cube.load()
    night = (cube["quality"].values & Quality.NIGHT_SIDE) != 0
    cast = night & (cube["incidence"].values < 90)
    print(f"{cast.sum()} pixels lie in a cast shadow, {night.sum()} on the night side or in shadow")
    assert cast.sum() > 5
    assert len(mesh_of(shaped).faces) == 4 * 24 * 24


def test_a_cube_whose_shape_model_is_gone_cannot_be_checked(shaped, tmp_path):
    copy = tmp_path / "copy.obj"
    copy.write_text(Path(shaped.shape).read_text())
    folder = publish(small_publication(size=64, radius_px=24.0, target=EUROPA.with_shape(copy)), tmp_path / "store")
    copy.unlink()
    assert any("cannot be checked" in fault.text for fault in product_faults(folder))
