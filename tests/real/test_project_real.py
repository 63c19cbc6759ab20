"""The projection against SPICE's own loop with real kernels and full aberration corrections."""

import numpy as np
import pytest

from catalog.camera import Camera
from catalog.pose import Pose
from catalog.spice import kernel_pool
from catalog.target import Target
from tasks.project.planes import ANGLES, project_planes

pytestmark = pytest.mark.real

CASES = [
    ("VOYAGER 1", "IO", "1979-03-04T19:22:59.82", 1500.19 * 84.821428, 0.01),
    ("-77", "EUROPA", "2000-05-22T23:52:05.277", 1500.46656 / 0.01524, 0.003),
]


def scene_from_spice(spacecraft, name, utc, focal_length_px):
    """A camera that looks at the target's centre, north up, at the pose SPICE knows."""
    import spiceypy

    et = spiceypy.str2et(utc)
    to_target, light_time = spiceypy.spkpos(name, et, "J2000", "LT+S", spacecraft)
    sun, _ = spiceypy.spkpos("SUN", et - light_time, "J2000", "LT+S", name)
    body_from_j2000 = spiceypy.pxform("J2000", f"IAU_{name}", et - light_time)
    boresight = to_target / np.linalg.norm(to_target)
    sample = np.cross(boresight, body_from_j2000[2])
    sample /= np.linalg.norm(sample)
    camera_from_j2000 = np.array([sample, np.cross(boresight, sample), boresight])
    camera = Camera(name="t", size_px=(600, 600), centre_px=(299.5, 299.5), focal_length_px=focal_length_px)
    target = Target(name=name, naif_id=1, radii_km=tuple(spiceypy.bodvrd(name, "RADII", 3)[1]))
    return Pose(et, camera_from_j2000, to_target, sun, body_from_j2000), camera, target


@pytest.mark.parametrize(("spacecraft", "name", "utc", "focal_length_px", "bar_deg"), CASES)
def test_one_pose_for_the_whole_disk_is_close_to_spice_with_light_time_and_aberration(
    data_folder, spacecraft, name, utc, focal_length_px, bar_deg
):
    import spiceypy

    kernels = data_folder / "kernels"
    with kernel_pool([kernels / "lsk", kernels / "pck", kernels / "spk"]), spiceypy.no_found_check():
        pose, camera, target = scene_from_spice(spacecraft, name, utc, focal_length_px)
        planes = project_planes(pose, camera, target, planes=ANGLES)
        rows, columns = np.nonzero(planes.emission < 60)
        chosen = np.random.default_rng(1).choice(len(rows), 300, replace=False)
        how = ("ELLIPSOID", name, pose.et, f"IAU_{name}", "LT+S", spacecraft)
        off = []
        for x, y in zip(columns[chosen], rows[chosen], strict=True):
            point, _, _, found = spiceypy.sincpt(*how, "J2000", pose.camera_from_j2000.T @ camera.ray([x, y]))
            assert found
            _, _, phase, incidence, emission = spiceypy.ilumin(*how, point)
            _, longitude, latitude = spiceypy.reclat(point)
            theirs = np.degrees([latitude, longitude, incidence, emission, phase])
            difference = (theirs - [planes[n][y, x] for n in ANGLES] + 180) % 360 - 180
            difference[1] *= np.cos(latitude)
            off.append(np.abs(difference))
    largest = dict(zip(ANGLES, np.max(off, axis=0).round(6).tolist(), strict=True))
    print(f"{spacecraft} at {name}, {pose.range_km:.0f} km: largest differences {largest} deg, bar {bar_deg}")
    assert max(largest.values()) < bar_deg
