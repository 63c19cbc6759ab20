"""Find the target in front of a larger bright body, or beside one: by what it hides of that body and by its own light.

What is much larger than the target is separated by a median over a square some target's diameters wide. Wherever the
target may be, it then is expected to take that light away and to add its own:

    image = dark level + behind (1 - coverage) + weight disk.

Where nothing is behind, this is the masked normalised cross-correlation of `coarse`.
"""

import numpy as np
from numpy.typing import NDArray

from catalog.observation import Observation
from catalog.pose import Pose
from tasks.compare.occulted import continued, levels
from tasks.compare.reduce import reduced_observation, reduced_scene, reduction_for
from tasks.point.coarse import TEMPLATE_DIAMETER_PX, CoarseFind, centred_window, lit_width_px, without_specks
from tasks.point.rotation import pose_pointed_at
from tasks.simulate import Scene
from tasks.simulate.window import disk_radius_px

Array = NDArray[np.float64]

# Side of the median's square, radii of the target: the target fills less than half of it.
SIDE_RADII = 3.6
# The median's cells: so many to the target's radius.
CELLS = 8
# Another body is one that is bright on so many times the target's disk.
LEAST_DISKS = 0.5


def find_in_front(observation: Observation, pose: Pose, scene: Scene, min_overlap: float) -> CoarseFind | None:
    """Place of the target in the frame, as `find_target`; None where no large bright body is in the frame,
    or where pixels that count as usable have no value."""
    share = scene.settings.behind_share
    if share is None or not np.isfinite(observation.image[observation.usable]).all():
        return None
    n = reduction_for(pose, scene, TEMPLATE_DIAMETER_PX)
    observation = without_specks(observation, lit_width_px(pose, scene))
    observation, scene = reduced_observation(observation, n), reduced_scene(scene, n)
    radius = disk_radius_px(pose, scene.camera, scene.target)
    dark, limit = levels(observation, radius, share)
    large = large_scale(observation, radius)
    if np.count_nonzero(large > limit) < LEAST_DISKS * np.pi * radius**2:
        return None
    frame_centre = (np.array(scene.camera.size_px) - 1) / 2
    centred = pose_pointed_at(pose, scene.camera, frame_centre)
    window = centred_window(centred, scene)
    simulation = scene.render(centred, window)
    image = np.where(observation.usable, observation.image, 0.0).astype(np.float64)
    disk, cover = (plane.astype(np.float64) for plane in (simulation.image(), simulation.coverage))
    best = (-1.0, 0.0, frame_centre)
    # Where no sky is in the frame the dark level is light of the body behind.
    for level in (dark, 0.0) if dark > limit - dark else (dark,):
        behind = np.maximum(large - level, 0.0)
        scores, counts = hidden_scores(image, observation.usable, behind, disk, cover, min_overlap)
        strength = evidence(scores, counts)
        row, column = np.unravel_index(int(np.argmax(strength)), scores.shape)
        ny, nx = window.shape
        place = frame_centre + np.array([column - nx + 1, row - ny + 1]) - np.array([window.x0, window.y0])
        best = max(best, (float(strength[row, column]), float(scores[row, column]), place), key=lambda found: found[0])
    return CoarseFind(pose_pointed_at(pose, scene.camera, best[2]), best[1], n)


def large_scale(observation: Observation, radius_px: float) -> Array:
    """The image (ny, nx) without what is as small as a disk of radius_px: a running median."""
    import cv2

    n = max(1, int(radius_px / CELLS))
    small = reduced_observation(observation, n)
    image = continued(small.image, small.usable) if small.usable.any() else small.image
    low, high = (float(v) for v in np.percentile(image, [0.1, 99.9]))
    eight_bit = np.clip((image - low) * (255 / max(high - low, 1e-12)), 0, 255).astype(np.uint8)
    side = 2 * int(SIDE_RADII * radius_px / n / 2) + 1
    median = cv2.medianBlur(eight_bit, max(side, 3)).astype(np.float32) * np.float32((high - low) / 255)
    median += np.float32(low)
    ny, nx = observation.image.shape
    whole = cv2.resize(median, (median.shape[1] * n, median.shape[0] * n), interpolation=cv2.INTER_LINEAR)
    return np.asarray(np.pad(whole, ((0, ny - whole.shape[0]), (0, nx - whole.shape[1])), mode="edge"), np.float64)


def hidden_scores(
    image: Array, usable: NDArray[np.bool_], behind: Array, disk: Array, cover: Array, min_overlap: float
) -> tuple[Array, Array]:
    """For every place of the template (full overlap range, as `scipy.signal.correlate` in mode "full"): the root of
    the share of what the image (ny, nx) has beyond `behind` (ny, nx) that a target there explains, 0 to 1, with the
    light behind it hidden and its own, `disk` (my, mx), of positive weight added; and on how many usable pixels the
    template lies. cover: (my, mx) coverage. 0 where that is less than `min_overlap` of the template."""
    from scipy import fft

    shape = [fft.next_fast_len(a + b - 1, real=True) for a, b in zip(image.shape, disk.shape, strict=True)]
    full = tuple(a + b - 1 for a, b in zip(image.shape, disk.shape, strict=True))
    scale = max(float(np.abs(image[usable]).max()), 1e-12) if usable.any() else 1.0
    u = usable.astype(np.float64)
    left, light = u * (image - behind) / scale, u * behind / scale
    disk = disk / max(float(disk.max()), 1e-12)

    def of_image(plane: Array) -> NDArray[np.complex128]:
        return np.asarray(fft.rfft2(plane, shape))

    def of_template(plane: Array) -> NDArray[np.complex128]:
        return np.asarray(fft.rfft2(plane[::-1, ::-1], shape))

    def summed(*products: NDArray[np.complex128]) -> Array:
        total = products[0] if len(products) == 1 else np.sum(products, axis=0)
        return np.asarray(fft.irfft2(total, shape)[: full[0], : full[1]])

    ones, d, c = of_template(np.ones_like(disk)), of_template(disk), of_template(cover)
    pixels, rest, hidden = of_image(u), of_image(left), of_image(light)
    count = np.maximum(summed(pixels * ones), 1e-9)
    sum_d, sum_dd = summed(pixels * d), summed(pixels * of_template(disk**2))
    sum_r, sum_rr = summed(rest * ones), summed(of_image(left**2) * ones)
    # With the light behind hidden, the disk has to explain what is left plus that light.
    sum_t = summed(rest * ones, hidden * c)
    sum_td = summed(rest * d, hidden * of_template(cover * disk))
    sum_tt = summed(
        of_image(left**2) * ones,
        2 * of_image(left * light) * c,
        of_image(light**2) * of_template(cover**2),
    )
    var_d = np.maximum(sum_dd - sum_d**2 / count, 1e-9)
    together = sum_td - sum_t * sum_d / count
    unexplained = sum_tt - sum_t**2 / count - np.maximum(together, 0) ** 2 / var_d
    before = np.maximum(sum_rr - sum_r**2 / count, 1e-9)
    scores = np.sqrt(np.clip(1 - unexplained / before, 0, 1))
    enough = (count >= min_overlap * disk.size) & (together > 0)
    return np.where(enough, scores, 0.0), count


def evidence(scores: Array, counts: Array) -> Array:
    """By how much the target's presence raises the logarithm of the likelihood of as many pixels, from the correlation:
    a corner of the template at the frame's edge fits easily, and tells little."""
    return -counts * np.log(np.maximum(1 - scores**2, 1e-12))
