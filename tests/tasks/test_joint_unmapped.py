"""The joint estimator on a target that no map is known of."""

from functools import cache

import numpy as np
import pytest

from catalog.basemap import uniform_map
from lab.simulate.small_world import observation_of, scene_of, small_camera, true_pose
from tasks.correction import Correction
from tasks.joint import JointSettings, find_pose_jointly
from tasks.point.rotation import pose_moved_by

RADIUS_PX = 40.0


@cache
def solved(body_has_markings: bool) -> tuple[Correction, np.ndarray, float]:
    """Correction from a pose that is wrong by (0.8, -0.6) px and 0.4 % of range, its error in px and in range."""
    camera = small_camera(2 * RADIUS_PX, (112, 104)).model_copy(update={"centre_px": (55.0, 51.0)})
    truth = true_pose(camera)
    body = scene_of(camera) if body_has_markings else scene_of(camera, basemap=uniform_map())
    start = pose_moved_by(truth, camera, (0.8, -0.6)).with_range_factor(1.004)
    scene = scene_of(camera, basemap=uniform_map(), oversample=2)
    settings = JointSettings(second_start=False, oversample=2)
    found = find_pose_jointly(observation_of(body, truth), start, start, "file", scene, settings)
    centre = camera.project(found.pose.target_in_camera_km) - camera.project(truth.target_in_camera_km)
    return found, centre, found.pose.range_km / truth.range_km - 1


@pytest.mark.parametrize("body_has_markings", [False, True])
def test_a_target_without_a_map_gets_pointing_range_and_roll_from_shape_and_shading(body_has_markings: bool) -> None:
    found, centre_px, range_error = solved(body_has_markings)
    sigma = found.uncertainty
    print(
        f"markings {body_has_markings}: centre {centre_px.round(3)} px, sigma {np.round(sigma['offset_px'], 3)}; range "
        f"{range_error:+.5f}, sigma {sigma['range_factor']:.5f}; roll {found.changed['roll_deg']:+.2f} deg, "
        f"sigma {sigma['roll_deg']:.2f}"
    )
    assert np.hypot(*centre_px) < (0.3 if body_has_markings else 0.1)
    assert abs(range_error) * RADIUS_PX < (0.3 if body_has_markings else 0.1)
    assert (np.abs(centre_px) < 4 * np.array(sigma["offset_px"])).all()
    assert abs(range_error) < 4 * sigma["range_factor"]
    assert abs(found.changed["roll_deg"]) < 4 * sigma["roll_deg"]


def test_its_attitude_stays_as_predicted_known_as_its_prior_says() -> None:
    found, *_ = solved(body_has_markings=False)
    unchecked = JointSettings().priors.unchecked_attitude_deg
    assert found.changed["attitude_deg"] is None
    assert found.uncertainty["attitude_deg"] == pytest.approx([unchecked] * 3)
    assert found.evidence["orientation"]["verdict"] == "no-map"
    assert "attitude" in "".join(found.evidence["held"])
    assert "uniform" in found.evidence["attitude_held"]
