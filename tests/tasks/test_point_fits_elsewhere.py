"""Where the target fits at two places of the frame, the place is in doubt."""

from dataclasses import replace

import numpy as np
import pytest

from lab.simulate.plant import planted
from lab.simulate.small_world import EUROPA, observation_of, scene_of, small_camera, true_pose
from tasks.point import PointSettings, find_pointing
from tasks.point.loop import doubt_of_rival
from tasks.simulate import Scene

CAMERA = small_camera(diameter_px=40.0, size_px=(224, 208))


@pytest.mark.parametrize("other", [None, "the same disk", "a brighter one", "a small square"])
@pytest.mark.parametrize("apart_px", [44, 70])
def test_a_second_disk_of_the_targets_kind_raises_the_doubt_and_nothing_else_does(
    other: str | None, apart_px: int
) -> None:
    scene: Scene = scene_of(CAMERA)
    truth = true_pose(CAMERA, centre_px=(70.3, 100.2))
    seen = observation_of(scene, truth)
    light = np.clip(seen.image - np.median(seen.image) - 4.0, 0, None)
    image = seen.image.copy()
    if other == "a small square":
        image[60:72, 70 + apart_px : 82 + apart_px] += 150
    elif other:
        image += np.roll(light, apart_px, axis=1) * (1.6 if other == "a brighter one" else 0.9)
    seen = replace(seen, image=image.astype(np.float32))
    found = find_pointing(seen, planted(truth, CAMERA, (6.0, -4.0), 1, (0, 0, 0)), scene, PointSettings())
    doubt = found.evidence.get("doubt")
    print(other, apart_px, doubt)
    if other in (None, "a small square"):
        assert doubt is None
        assert np.hypot(*(CAMERA.project(found.pose.target_in_camera_km) - (70.3, 100.2))) < 0.1
    else:
        assert doubt is not None
        assert doubt.startswith("fits-elsewhere: ")
        assert EUROPA.name in doubt


def test_where_the_user_says_where_the_target_is_nothing_else_is_looked_for() -> None:
    truth = true_pose(CAMERA, centre_px=(70.3, 100.2))
    seen = observation_of(scene_of(CAMERA), truth)
    twice = replace(seen, image=np.maximum(seen.image, np.roll(seen.image, 80, axis=1)))
    found = find_pointing(twice, truth, scene_of(CAMERA), PointSettings(coarse=False))
    assert "doubt" not in found.evidence


@pytest.mark.parametrize("rival_px", [(-30.0, -30.0), (-16.0, 90.0), (250.0, 230.0)])
def test_a_place_where_hardly_any_of_the_disk_would_be_in_the_frame_is_no_second_one(
    rival_px: tuple[float, float],
) -> None:
    scene, truth = scene_of(CAMERA), true_pose(CAMERA, centre_px=(70.3, 100.2))
    seen, rival = observation_of(scene, truth), true_pose(CAMERA, centre_px=rival_px)
    certain = PointSettings(rival_likeness=0.0)
    assert doubt_of_rival(seen, truth, rival, 1.0, scene, certain) is None
