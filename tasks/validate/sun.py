"""Is the Sun where the metadata say? The terminator and the shading of the disk show it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.errors import FailedError
from catalog.observation import Observation
from catalog.pose import Pose
from catalog.reasons import Reason
from tasks.compare.brightness import robust_least_squares
from tasks.compare.match import MODEL_ERROR
from tasks.compare.occulted import finer, light_behind
from tasks.compare.reduce import reduced_observation, reduced_scene, reduction_for
from tasks.joint.derivatives import changes_of_place
from tasks.joint.surface import fine_surface
from tasks.point.rotation import pose_moved_by
from tasks.simulate import Scene
from tasks.simulate.photometry import BASES
from tasks.simulate.pixels import detect
from tasks.simulate.suns import with_sun_moved
from tasks.simulate.window import Window, disk_radius_px
from tasks.validate.albedo import albedo_terms, spread_by_albedo

Array = NDArray[np.float64]
Image = NDArray[np.float32]

# Shading is smooth: so many pixels across the disk tell where the Sun is, and so many sub-pixels.
DIAMETER_PX, ACROSS = 60.0, 180.0
MARGIN_PX = 6.0
ITERATIONS, STILL_DEG, NEAR_DEG = 20, 0.2, 3.0
# Degrees: of the numerical derivatives, and of the largest step that the linearisation bears; pixels of the disk.
DIFFERENCE_DEG, LARGEST_DEG, LARGEST_PX = 1.0, 15.0, 1.0
# Below this distance from the spacecraft, or from the point behind the target, the Sun has no azimuth in the image.
LEAST_PHASE_DEG = 3.0
# What laws and maps move the Sun by, beyond what the residuals show, degrees, 1-sigma: measured on simulated images of
# other laws and maps with the right Sun (azimuth as an angle on the sky 2.7 at most, phase 2.4), and on real ones (1.0,
# and 6 of phase on Pluto by LORRI).
ACROSS_SIGMA_DEG, PHASE_SIGMA_DEG = 1.0, 2.5
# On a small disk laws and blur move the terminator by a share of a pixel: with the right Sun the phase of disks of 5 to
# 8 px radius came out 11 to 15 degrees off.
TERMINATOR_SIGMA_PX = 0.6
# Blocks of so many pixels of the reduced disk in which a map's or a law's errors go together.
BLOCK_PX = 6


@dataclass(frozen=True)
class SunReport:
    """Where the image puts the Sun, relative to the metadata, degrees. azimuth_deg: turn about the line of sight, from
    +x towards +y of the image; phase_deg: change of the phase angle; each with its 1-sigma, None where it did not come
    to rest. across_deg, across_sigma_deg: the azimuth's turn as an angle on the sky, which stays meaningful near
    opposition."""

    azimuth_deg: float | None = None
    azimuth_sigma_deg: float | None = None
    phase_deg: float | None = None
    phase_sigma_deg: float | None = None
    across_deg: float | None = None
    across_sigma_deg: float | None = None


def sun_in_image(observation: Observation, pose: Pose, scene: Scene) -> SunReport:
    """Least squares for the Sun's direction at a corrected pose, with the weights of the photometric laws, an even
    background, centre and size of the disk solved along; at reduced resolution.

    The sigmas are by the residuals, errors that neighbouring pixels share included, by smooth errors of the map's
    albedo (see `spread_by_albedo`), and by what laws do.
    """
    return solved_with_sun(observation, pose, scene)[0]


def solved_with_sun(observation: Observation, pose: Pose, scene: Scene) -> tuple[SunReport, Pose]:
    """The same, and the pose with centre, range and Sun of that solution; as it was where it did not come to rest."""
    n = reduction_for(pose, scene, DIAMETER_PX)
    seen, small = reduced_observation(observation, n), reduced_scene(scene, n)
    trial, claimed = pose, pose
    away, both = np.zeros(2), False
    for _ in range(ITERATIONS):
        try:
            step, covariance = _step(seen, trial, small, away, claimed, both)
        except FailedError:
            return SunReport(), pose
        share = max(float(np.abs(step[3:]).max()) / LARGEST_DEG, float(np.abs(step[:2]).max()) / LARGEST_PX, 1.0)
        step = step / share
        trial = pose_moved_by(trial, small.camera, step[:2]).with_range_factor(float(np.exp(step[2])))
        away = away + step[3:]
        phase = claimed.phase_deg + away[1]
        if not LEAST_PHASE_DEG < phase < 180 - LEAST_PHASE_DEG:
            return SunReport(), pose
        still = np.abs(step[3:]).max() < max(STILL_DEG, 0.1 * float(np.sqrt(np.diag(covariance)[3:]).min()))
        if both and still:
            report = _report(away, covariance, claimed, disk_radius_px(claimed, scene.camera, scene.target))
            return report, with_sun_moved(trial, float(away[0]), float(away[1]))
        # With an azimuth far off, the phase would only make the best of it.
        both = both or abs(step[3]) < NEAR_DEG
    return SunReport(), pose


def _report(away: Array, covariance: Array, claimed: Pose, radius_px: float) -> SunReport:
    wide = float(np.sin(np.radians(claimed.phase_deg + away[1] / 2)))
    by_place_deg = float(np.degrees(TERMINATOR_SIGMA_PX / radius_px))
    systematic = np.hypot((ACROSS_SIGMA_DEG, PHASE_SIGMA_DEG), by_place_deg) / (wide, 1)
    sigma = np.hypot(np.sqrt(np.diag(covariance)[3:]), systematic)
    return SunReport(
        azimuth_deg=float(away[0]),
        azimuth_sigma_deg=float(sigma[0]),
        phase_deg=float(away[1]),
        phase_sigma_deg=float(sigma[1]),
        across_deg=float(away[0]) * wide,
        across_sigma_deg=float(sigma[0]) * wide,
    )


def _step(seen: Observation, trial: Pose, scene: Scene, away: Array, claimed: Pose, both: bool) -> tuple[Array, Array]:
    """Gauss-Newton step (5,) of centre (px), logarithm of the range, azimuth and phase (deg), and covariance (5, 5);
    the phase stays unless `both`."""
    window = scene.window(trial, MARGIN_PX)
    oversample = int(np.clip(np.ceil(ACROSS / (2 * max(_radius(window), 1.0))), 1, 6))
    image, usable = window.crop(seen.image), window.crop(seen.usable, fill=False)
    usable = usable & np.isfinite(image)
    if not usable.any():
        raise FailedError(Reason.NO_USABLE_PIXELS, "no usable pixels lie under the simulated target.")
    image = np.where(usable, image, 0).astype(np.float32)
    behind = light_behind(seen, trial, scene, window)
    bright = max(float(np.percentile(image[usable], 95)), 1e-6)
    variance = window.crop(seen.noise, fill=1).astype(np.float64) ** 2 + (MODEL_ERROR * bright) ** 2
    weight = np.where(usable, 1 / variance, 0).astype(np.float32)
    if behind is not None:
        image, weight = np.where(usable, image - behind.light, 0).astype(np.float32), weight * behind.near
        weight = (weight / (1 + weight * behind.sigma**2)).astype(np.float32)

    def shaded(azimuth_deg: float, phase_deg: float) -> Image:
        moved = with_sun_moved(trial, away[0] + azimuth_deg, away[1] + phase_deg)
        return _shaded(scene, moved, claimed.phase_deg, window, oversample)

    fine = shaded(0, 0)
    laws = len(fine)
    if behind is not None:
        cover = fine_surface(scene, trial, window, oversample).cover
        fine = np.concatenate([fine, -(finer(behind.light, oversample) * cover)[None]])
    bases = np.stack([detect(each, oversample, scene.psf_sigma_px) for each in fine])
    flat = np.ones((1, *bases.shape[1:]), np.float32)
    values, _, _ = robust_least_squares(np.concatenate([bases, flat]), image, weight)
    weights = values[:-1].astype(np.float32)
    centre = scene.camera.project(trial.target_in_camera_km) - (window.x0, window.y0)
    moving = np.empty((8, *image.shape), np.float32)
    here = np.tensordot(weights, fine, 1)
    changes_of_place(here, centre, oversample, scene.psf_sigma_px, moving)
    by_sun = [
        detect(
            np.tensordot(weights[:laws], shaded(*step) - shaded(-step[0], -step[1]), 1), oversample, scene.psf_sigma_px
        )
        / np.float32(2 * DIFFERENCE_DEG)
        for step in ((DIFFERENCE_DEG, 0.0), (0.0, DIFFERENCE_DEG))[: 1 + both]
    ]
    columns = np.concatenate([bases, flat, moving[:3], np.stack(by_sun)])
    values, covariance, _ = robust_least_squares(columns, image, weight)
    residual = (image - np.tensordot(values.astype(np.float32), columns, 1)) * np.sqrt(weight)
    first, shared = len(bases) + 1, _shared(residual)
    step, errors = np.zeros(5), np.zeros((5, 5))
    solved = len(columns) - first
    step[:solved] = values[first:]
    y, x = (np.indices(image.shape) - centre[::-1, None, None]) / _radius(window)
    sun = (trial.camera_from_j2000 @ with_sun_moved(trial, *away).sun_from_target_km)[:2]
    (along, across) = sun / max(float(np.hypot(*sun)), 1e-300)
    terms = albedo_terms(along * x + across * y, along * y - across * x)
    light = np.tensordot(weights, bases, 1)
    spread = spread_by_albedo(columns, light, residual, weight, terms, shared)
    errors[:solved, :solved] = covariance[first:, first:] * shared + spread[first:, first:]
    return step, errors


def _shaded(scene: Scene, pose: Pose, phase_deg: float, window: Window, oversample: int) -> Image:
    """Basis images (k, ny * s, nx * s) of a mixture of laws, the map's albedo in them."""
    surface = fine_surface(scene, pose, window, oversample)
    value = surface.albedo * surface.cover
    return np.stack([law(surface.mu0, surface.mu, phase_deg) * value for law in BASES["mixture"]])


def _radius(window: Window) -> float:
    return min(window.shape) / 2 - MARGIN_PX


def _shared(residual: Image) -> float:
    """Mean square of the sums of blocks by the sum of squares: how many pixels err together."""
    ny, nx = (size // BLOCK_PX * BLOCK_PX for size in residual.shape)
    blocks = residual[:ny, :nx].astype(np.float64).reshape(ny // BLOCK_PX, BLOCK_PX, nx // BLOCK_PX, BLOCK_PX)
    squares = float((blocks**2).sum())
    return max(float((blocks.sum(axis=(1, 3)) ** 2).sum()) / squares, 1.0) if squares > 0 else 1.0
