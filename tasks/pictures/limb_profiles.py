"""Brightness along the limb segments, image beside simulation, under the predicted and the corrected pose."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.observation import Observation
from catalog.pose import Pose
from tasks.compare.limb_edges import LimbSettings, measure_limb
from tasks.compare.match import framed_window, match_scene
from tasks.compare.segments import Segments, profiles
from tasks.pictures.product import Product
from tasks.project.curves import limb_points
from tasks.simulate import Scene
from tasks.simulate.window import disk_radius_px

Array = NDArray[np.float64]
# Segments that reach farther into the disk than this part of its radius would meet markings before the limb.
LONGEST_REACH_RADII = 0.45


@dataclass(frozen=True)
class LimbProfiles:
    """n measured segments. image, simulation: (n, 2h+1) brightness along each, outward to the right. steps_px: (n,
    2h+1) distance from the predicted limb, outward. shift_px: (n,) image minus simulation, outward positive.
    limb_px: (m, 2) the whole limb."""

    segments: Segments
    image: Array
    simulation: Array
    steps_px: Array
    shift_px: Array
    limb_px: Array
    settings: LimbSettings

    @property
    def rms_px(self) -> float | None:
        """RMS of the shifts; None when too few could be measured."""
        enough = len(self.shift_px) >= self.settings.min_points
        return float(np.sqrt(np.mean(self.shift_px**2))) if enough else None

    def falls(self, values: Array) -> Array:
        """How fast brightness falls outward, per pixel (n, 2h-1): the derivative whose extremum is the limb."""
        from scipy.ndimage import gaussian_filter1d

        smooth = gaussian_filter1d(values, max(self.settings.smooth_px, 1e-3), axis=1, mode="nearest")
        return (smooth[:, :-2] - smooth[:, 2:]) / 2


def limb_profiles(observation: Observation, pose: Pose, scene: Scene, settings: LimbSettings) -> LimbProfiles:
    """Measure the lit limb under `pose` as `validate_limb` does, and keep the brightness along the segments.

    Raises FailedError when nothing of the target is on usable pixels.
    """
    match = match_scene(
        observation, scene.with_rendered_limb(), pose, framed_window(scene, pose, margin_px=settings.half_px + 8)
    )
    edges = measure_limb(match, settings)
    segments = edges.segments
    outward = np.sign(np.where(segments.horizontal, segments.normal[:, 0], segments.normal[:, 1]))
    half = settings.half_px
    nearest = np.rint(segments.crossing)
    steps = np.arange(-half, half + 1) + (nearest - segments.crossing)[:, None] * outward[:, None]

    def along(image: Array) -> Array:
        values = profiles(image, segments, match.origin, half)
        return np.where(outward[:, None] < 0, values[:, ::-1], values)

    return LimbProfiles(
        segments=segments,
        image=along(match.image.astype(np.float64)),
        simulation=along(edges.model),
        steps_px=steps,
        shift_px=edges.shift_px * outward,
        limb_px=limb_points(pose, scene.camera, scene.target, 720),
        settings=settings,
    )


@dataclass(frozen=True)
class LimbComparison:
    """before: under the predicted pose, None when its limb is too far away (`apart_px`). after: under the corrected
    pose."""

    product: Product
    before: LimbProfiles | None
    after: LimbProfiles
    apart_px: float


def compare_limbs(product: Product) -> LimbComparison:
    """The limb of a product before and after its correction; before, the segments reach as far as they must."""
    after = limb_profiles(product.observation, product.after, product.scene, product.limb)
    apart = _apart_px(product, after)
    radius = disk_radius_px(product.after, product.scene.camera, product.scene.target)
    if not apart + product.limb.half_px <= LONGEST_REACH_RADII * radius:
        return LimbComparison(product, None, after, apart)
    reach = int(np.ceil(apart)) + product.limb.half_px
    longer = product.limb.model_copy(update={"half_px": reach})
    before = limb_profiles(product.observation, product.before, product.scene, longer)
    return LimbComparison(product, before if len(before.shift_px) else None, after, apart)


def _apart_px(product: Product, after: LimbProfiles) -> float:
    """How far the predicted limb lies from the corrected one, at most."""
    before = limb_points(product.before, product.scene.camera, product.scene.target, 720)
    if not np.isfinite(before).all():
        return float("inf")
    distance = np.linalg.norm(after.limb_px[::8, None] - before[None], axis=2).min(axis=1)
    return float(distance.max())
