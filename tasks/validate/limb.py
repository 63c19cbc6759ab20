"""Validate: is the limb where the simulation has it? (paper, section 4.2)."""

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from catalog.observation import Observation
from catalog.pose import Pose
from catalog.robust import sigma_about_zero
from tasks.compare.brightness import correlation
from tasks.compare.likeness import likeness, with_rim
from tasks.compare.limb_edges import LimbEdges, LimbSettings, measure_limb
from tasks.compare.match import Match, framed_window, match_scene
from tasks.compare.segments import Segments, profiles
from tasks.compare.similarity import ssim
from tasks.fields import Content
from tasks.plain import plain
from tasks.simulate import Scene
from tasks.simulate.window import disk_radius_px

Array = NDArray[np.float64]
# Shifts beyond so many robust sigmas (by the median of their sizes) count as if they were just there.
CLIPPED_SIGMAS = 2.5
# Below this a robust sigma is the sampling's, not the limb's.
LEAST_SIGMA_PX = 0.02
# What pixels (1/12) and the central difference of `edge_width` (1/3) add to the variance of an edge.
SAMPLING_PX2 = 1 / 12 + 1 / 3


class ValidateSettings(LimbSettings):
    """disagree_px: a segment whose limb lies farther, across the limb, from where the simulation has it disagrees."""

    disagree_px: float = Field(1.0, gt=0)


class LimbFigures(Content):
    """rms_px, mean_px (x, y): of the shifts along rows and columns, image minus simulation; None when fewer than the
    settings' min_points segments could be measured. points: segments measured; tried: lit segments on usable pixels.
    normal_rms_px, normal_median_px: of the shifts' part across the limb, outward. robust_px: of that part, the RMS
    about zero with what single segments are off clipped, see `robust_rms`; blur: see `blur_of`; psf_sigma_px: width of
    the PSF by that; disagreeing: share of the segments off by more than the settings' disagree_px. similarity: SSIM,
    and correlation, of image and simulation; likeness: the correlation with a wide rim of sky, see `likeness`."""

    rms_px: float | None
    mean_px: tuple[float, float] | None
    normal_rms_px: float | None
    normal_median_px: float | None
    robust_px: float | None
    disagreeing: float | None
    blur: float | None
    psf_sigma_px: float | None
    points: int
    tried: int
    similarity: float | None
    correlation: float | None
    likeness: float


class LimbReport(LimbFigures):
    """The figures of a limb, and its segments for the pictures: xy_px (n, 2), shift_px (n,), horizontal (n,)."""

    xy_px: Array = Field(repr=False)
    shift_px: Array = Field(repr=False)
    horizontal: NDArray[np.bool_] = Field(repr=False)

    def figures(self) -> LimbFigures:
        """All but the arrays."""
        return LimbFigures(**{name: getattr(self, name) for name in LimbFigures.model_fields})


def validate_limb(
    observation: Observation, pose: Pose, scene: Scene, settings: ValidateSettings | None = None
) -> LimbReport:
    """Shift of the derivative's extremum between image and simulation on every segment across the lit limb, which
    Mitsuba renders whatever found the pose."""
    settings = settings or ValidateSettings()
    window = framed_window(scene, pose, margin_px=margin_px(settings))
    match = match_scene(observation, scene.with_rendered_limb(), pose, window)
    edges = measure_limb(match, settings)
    wide = with_rim(observation, pose, scene)
    shift, horizontal = edges.shift_px, edges.segments.horizontal
    enough = len(shift) >= settings.points_needed(disk_radius_px(pose, scene.camera, scene.target))
    blur = blur_of(match, edges, settings) if enough else None
    return LimbReport(
        rms_px=_rms(shift) if enough else None,
        mean_px=(_mean(shift[horizontal]), _mean(shift[~horizontal])) if enough else None,
        normal_rms_px=_rms(edges.across_px) if enough else None,
        normal_median_px=float(np.median(edges.across_px)) if enough else None,
        robust_px=robust_rms(edges.across_px) if enough else None,
        disagreeing=float(np.mean(np.abs(edges.across_px) > settings.disagree_px)) if enough else None,
        blur=blur,
        psf_sigma_px=None if blur is None else psf_of_blur(blur, scene.psf_sigma_px),
        points=len(shift),
        tried=edges.tried,
        similarity=plain(ssim(match.image, edges.model, match.usable)),
        correlation=plain(correlation(match.image, edges.model, match.usable)),
        likeness=likeness(wide),
        xy_px=edges.segments.xy_px,
        shift_px=shift,
        horizontal=horizontal,
    )


def margin_px(settings: ValidateSettings) -> float:
    """Sky around the disk that segments and similarity are measured on."""
    return settings.half_px + 8.0


def blur_of(match: Match, edges: LimbEdges, settings: ValidateSettings) -> float:
    """How many times as wide as in the simulation the limb's edge is in the image, median over the segments. The width
    of an edge: the brightness along the segment, from its least to its most, by the steepest fall."""
    image, model = (
        np.median(edge_width(profiles(picture, edges.segments, match.origin, settings.half_px), edges.segments))
        for picture in (match.image.astype(np.float64), edges.model)
    )
    return float(image / max(model, 1e-9))


def psf_of_blur(blur: float, simulated_px: float) -> float:
    """1-sigma width, px, of the PSF that makes the limb `blur` times as wide as one of `simulated_px` does; 0 where it
    is sharper than pixels can show."""
    variance = blur**2 * (simulated_px**2 + SAMPLING_PX2) - SAMPLING_PX2
    return float(np.sqrt(max(variance, 0.0)))


def edge_width(values: Array, segments: Segments) -> Array:
    """Widths (n,), px, of edges along segments (n, 2*half+1)."""
    outward = np.sign(np.where(segments.horizontal, segments.normal[:, 0], segments.normal[:, 1]))
    fall = -outward[:, None] * (values[:, 2:] - values[:, :-2]) / 2
    return np.asarray(np.ptp(values, axis=1) / np.maximum(fall.max(axis=1), 1e-9))


def robust_rms(shift_px: Array) -> float:
    """Root mean square about zero of shifts (n,), each clipped at CLIPPED_SIGMAS robust sigmas.

    Some segments that lock onto an edge of albedo inside the limb hardly count; a limb that lies elsewhere, or is
    larger, as a whole does, by as much as it is off (winsorised second moment: Huber, Robust Statistics, 1981).
    """
    size = np.abs(shift_px)
    sigma = max(sigma_about_zero(size), LEAST_SIGMA_PX)
    return _rms(np.minimum(size, CLIPPED_SIGMAS * sigma))


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _mean(values: Array) -> float:
    return float(values.mean()) if values.size else 0.0
