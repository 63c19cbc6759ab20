"""Another shape than the target's: a doubt where no markings show which body it is."""

from dataclasses import replace

import numpy as np
import pytest

from catalog.target import find_target
from lab.simulate.small_world import scene_of, small_camera, true_pose
from tasks.joint.displaced_markings import SEEN, UNSEEN, Displacement
from tasks.joint.shape import doubt_of_displacement, doubt_of_relief, doubt_of_shape, shear_of_outline
from tasks.joint.thresholds import Thresholds
from tasks.simulate import Scene

CAMERA = small_camera(90.0, (124, 124)).model_copy(update={"centre_px": (61.5, 61.5)})
LIMITS = Thresholds()


def displacement(shear_px: tuple[float, float], noise_px: float = 0.08) -> Displacement:
    found = np.zeros(SEEN)
    found[:2] = shear_px
    return Displacement(0.1, found, np.eye(SEEN) * noise_px**2, np.zeros((8, UNSEEN + SEEN)))


def of(name: str, **changed: float) -> Scene:
    scene = scene_of(CAMERA)
    return Scene(CAMERA, find_target(name).model_copy(update=changed), scene.basemap, settings=scene.settings)


@pytest.mark.parametrize(
    ("name", "shear_px", "noise_px", "doubted"),
    [
        ("triton", (0.05, -0.1), 0.08, False),
        ("triton", (0.4, -0.4), 0.08, True),
        ("triton", (0.3, -0.3), 0.2, False),
        ("tethys", (-0.8, -0.25), 0.1, True),
    ],
)
def test_a_shape_beyond_its_error_is_doubted(
    name: str, shear_px: tuple[float, float], noise_px: float, doubted: bool
) -> None:
    scene, pose = of(name), true_pose(CAMERA, phase_deg=50.0)
    doubt = doubt_of_shape(displacement(shear_px, noise_px), pose, scene, 3.0, LIMITS)
    assert (doubt is not None) == doubted
    if doubt:
        assert doubt.startswith("shape-disagrees: ")


@pytest.mark.parametrize(
    ("shown_px", "radius_px", "relief_km", "doubted"),
    [
        (0.475, 53.0, 0.32, True),  # a scene of the benchmark: 3 % of relief, 6 deg off
        (0.22, 54.0, 0.32, False),
        (0.29, 12.0, 0.32, False),
        (0.6, 400.0, 0.32, False),  # 0.15 %: optics, and no turn of a degree
        (0.9, 53.0, 20.0, False),
        (0.0, 53.0, 0.0, False),
    ],
)
def test_a_limb_much_rougher_than_stated_is_doubted(
    shown_px: float, radius_px: float, relief_km: float, doubted: bool
) -> None:
    target = find_target("europa").model_copy(update={"relief_km": relief_km})
    doubt = doubt_of_relief(shown_px, radius_px, target, LIMITS.contradiction)
    assert (doubt is not None) == doubted
    assert not doubt or doubt.startswith("shape-disagrees: ")


@pytest.mark.parametrize(
    ("size_px", "expected_px", "doubted"),
    [
        (0.29, 0.3, False),  # optics that bend by 0.3 px, at most
        (0.32, 0.3, True),  # radii wrong by 2 %, three lines left out, columns 3 % too far apart
        (0.32, 0.6, False),
        (5.0, None, False),
    ],
)
def test_a_displacement_larger_than_optics_make_is_doubted(
    size_px: float, expected_px: float | None, doubted: bool
) -> None:
    found = replace(displacement((0.5, 0.4)), size_px=size_px)
    doubt = doubt_of_displacement(found, expected_px)
    assert (doubt is not None) == doubted
    assert not doubt or doubt.startswith("shape-disagrees: ")
    assert doubt_of_displacement(None, 0.3) is None


def test_relief_that_the_target_s_file_states_is_no_other_shape() -> None:
    pose, found = true_pose(CAMERA, phase_deg=50.0), displacement((0.5, 0.4))
    assert doubt_of_shape(found, pose, of("triton", relief_km=0.0), 3.0, LIMITS) is not None
    assert doubt_of_shape(found, pose, of("triton", relief_km=30.0), 3.0, LIMITS) is None


def test_the_outline_of_a_sphere_does_not_turn_and_that_of_an_ellipsoid_does() -> None:
    pose, few = true_pose(CAMERA, phase_deg=50.0), LIMITS.orientation.fewest_directions
    sphere = shear_of_outline(pose, of("triton", relief_km=0.0), 10.0, few)
    assert np.abs(sphere).max() == pytest.approx(0, abs=1e-9)
    mimas = of("mimas", relief_km=0.0)
    once, thrice = (np.trace(shear_of_outline(pose, mimas, sigma, few)) for sigma in (2.0, 6.0))
    assert once > 0
    assert thrice == pytest.approx(9 * once, rel=0.5)
