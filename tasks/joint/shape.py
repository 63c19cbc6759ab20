"""Whether limb and shading show the shape of the target, where no markings say that the body is the target.

Another body of about the target's size, whose range is known to some per cent, passes for it but for its shape: its
axes displace limb, terminator and shading against those of the target's ellipsoid, and so does relief that the target's
file does not state, or an orientation far off. The displacement that looks like no other centre, range or roll (see
`displaced_markings`) is compared with what noise, stated relief and the prior of the orientation make of it.
"""

import numpy as np
from numpy.typing import NDArray

from catalog.pose import Pose
from catalog.reasons import Reason
from catalog.rotation import rotation_from_vector_deg
from catalog.target import Target
from tasks.compare.limb_errors import relief_covariance
from tasks.joint.contradiction import chi_square
from tasks.joint.displaced_markings import SEEN, Displacement
from tasks.joint.outline import DIRECTIONS, SAMPLES, outline
from tasks.joint.thresholds import ContradictionThresholds, Thresholds
from tasks.simulate import Scene
from tasks.simulate.window import disk_radius_px

Array = NDArray[np.float64]

# Of the terms of `displaced_markings` the first two are of an ellipse.
SHEAR = slice(0, 2)


def doubt_of_shape(
    found: Displacement, pose: Pose, scene: Scene, attitude_deg: float, limits: Thresholds
) -> str | None:
    """The doubt that the displacement raises at the solution's pose. attitude_deg: 1-sigma of the orientation, about
    each axis."""
    allowed = np.diag(shear_of_outline(pose, scene, attitude_deg, limits.orientation.fewest_directions))
    # Relief and turns move the other terms about as much as the shear.
    expected = np.diag(found.noise) + np.concatenate([allowed, np.full(SEEN - len(allowed), allowed.mean())])
    # A small disk's few groups of residuals tell the terms' variances, not what they have in common.
    squares = float((found.found_px**2 / expected).sum())
    if squares <= chi_square(SEEN, limits.contradiction.chance_shape):
        return None
    return (
        f"{Reason.SHAPE_DISAGREES}: limb and shading show another shape than the target's (displaced by an ellipse of "
        f"{np.hypot(*found.found_px[SHEAR]):.2f} px and more, {np.sqrt(squares / SEEN):.1f} times the errors), and no "
        "markings show that the body is the target. Check the target, its radii and relief, its orientation and the "
        "camera's distortion."
    )


def doubt_of_displacement(found: Displacement | None, expected_px: float | None) -> str | None:
    """The doubt that limb and markings raise which lie off by a smooth displacement whose terms are larger than optics
    are expected to make them, `expected_px` (1-sigma): then something else is wrong, and errors that count it as
    optics are no measure of it."""
    if found is None or expected_px is None or found.size_px <= expected_px:
        return None
    return (
        f"{Reason.SHAPE_DISAGREES}: limb and markings lie off smoothly, by {found.size_px:.2f} px per term of a "
        f"displacement where optics that no file tells of are expected to make {expected_px:g} px "
        "(joint.displaced_px). Check the target's radii, its orientation, the camera's distortion, and whether pixels "
        "are square and no lines are missing."
    )


def doubt_of_relief(shown_px: float, radius_px: float, target: Target, limits: ContradictionThresholds) -> str | None:
    """The doubt that a limb raises whose arcs lie off as a whole by `shown_px` (RMS) on a disk of `radius_px`."""
    stated_px = target.expected_relief_km / target.mean_radius_km * radius_px
    if shown_px <= max(limits.relief_px, limits.relief_share * radius_px, limits.relief_stated * stated_px):
        return None
    return (
        f"{Reason.SHAPE_DISAGREES}: whole arcs of the limb lie {shown_px:.2f} px (RMS) off the target's ellipsoid, "
        f"where {stated_px:.2f} px of relief are expected; markings of such a surface are displaced, and the "
        "orientation with them. Check the target, its radii and relief_km, and the camera's distortion."
    )


def shear_of_outline(pose: Pose, scene: Scene, sigma_deg: float, fewest_directions: int) -> Array:
    """Covariance (2, 2), px at the limb, of the lit limb's ellipse (cosine and sine of twice the angle, outward) when
    the body may be turned by `sigma_deg`, 1-sigma about each axis, and by the relief that its file states."""
    angle = np.linspace(-np.pi, np.pi, DIRECTIONS, endpoint=False)
    here, lit = outline(pose, scene, angle)
    if lit.sum() < fewest_directions:
        return np.eye(2) * disk_radius_px(pose, scene.camera, scene.target) ** 2
    terms = (np.cos(angle), np.sin(angle), np.ones_like(angle), np.cos(2 * angle), np.sin(2 * angle))
    design = np.column_stack(terms)[lit]
    relief = scene.target.expected_relief_km / scene.target.mean_radius_km
    relief_px = relief * disk_radius_px(pose, scene.camera, scene.target)
    spread = relief_covariance(design, np.degrees(angle[lit]) % 360, relief_px)[3:, 3:]
    if np.ptp(scene.target.radii_km) == 0:
        return spread
    for turn in np.random.default_rng(1).standard_normal((SAMPLES, 3)) * sigma_deg:
        turned = pose.replaced(body_from_j2000=rotation_from_vector_deg(turn).T @ pose.body_from_j2000)
        there, _ = outline(turned, scene, angle)
        step = np.linalg.lstsq(design, (there - here)[lit], rcond=None)[0][3:]
        spread += np.outer(step, step) / SAMPLES
    return np.asarray(spread)
