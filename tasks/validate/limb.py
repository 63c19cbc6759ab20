"""Validate: is the limb where the simulation has it? (paper, section 4.2)."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from catalog.observation import Observation
from catalog.pose import Pose
from tasks.point.registration.base import Match, match_under_window
from tasks.point.registration.intensity import correlation, fit_brightness
from tasks.range.similarity import ssim
from tasks.simulate import Scene
from tasks.validate.segments import Segments, limb_segments, profiles

Array = NDArray[np.float64]


class ValidateSettings(BaseModel):
    """half_px: reach of a segment to each side. smooth_px: Gaussian width of the derivative. max_incidence_deg: only
    limb points better lit than this. min_contrast: a segment's simulated step, in sigmas of the noise."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    half_px: int = Field(8, ge=3)
    smooth_px: float = Field(1.0, ge=0)
    max_incidence_deg: float = Field(80.0, gt=0, le=90)
    min_contrast: float = Field(5.0, ge=0)
    min_points: int = Field(16, ge=1)


@dataclass(frozen=True)
class LimbReport:
    """rms_px, mean_px (x, y): of the shifts along rows and columns, image minus simulation; None when no segment could
    be measured. points: segments measured; tried: lit segments on usable pixels. normal_rms_px: of the shifts' part
    across the limb. similarity: SSIM and correlation of image and simulation. xy_px, shift_px: for the pictures."""

    rms_px: float | None
    mean_px: tuple[float, float] | None
    normal_rms_px: float | None
    normal_median_px: float | None
    points: int
    tried: int
    similarity: float
    correlation: float
    xy_px: Array = field(repr=False)
    shift_px: Array = field(repr=False)
    horizontal: NDArray[np.bool_] = field(repr=False)

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values, the arrays left out."""
        names = ("rms_px", "mean_px", "normal_rms_px", "normal_median_px", "points", "tried", "similarity", "correlation")
        return {name: getattr(self, name) for name in names}


def validate_limb(
    observation: Observation, pose: Pose, scene: Scene, settings: ValidateSettings | None = None
) -> LimbReport:
    """Shift of the derivative's extremum between image and simulation on every segment across the lit limb."""
    settings = settings or ValidateSettings()
    match = match_under_window(observation, scene.render(pose, scene.window(pose, margin_px=settings.half_px + 8)))
    model, _ = fit_brightness(match, match.simulation.bases)
    segments = usable_segments(limb_segments(pose, scene), match, model, settings)
    origin = (match.simulation.window.x0, match.simulation.window.y0)
    seen, simulated = (
        edge_position(profiles(a, segments, origin, settings.half_px), segments, settings) for a in (match.image, model)
    )
    shift = seen - simulated
    measured = np.isfinite(shift)
    shift, kept = shift[measured], segments.chosen(measured)
    enough = len(kept) >= settings.min_points
    along = np.where(kept.horizontal, kept.normal[:, 0], kept.normal[:, 1])
    across = shift * along
    return LimbReport(
        rms_px=float(np.sqrt(np.mean(shift**2))) if enough else None,
        mean_px=(_mean(shift[kept.horizontal]), _mean(shift[~kept.horizontal])) if enough else None,
        normal_rms_px=float(np.sqrt(np.mean(across**2))) if enough else None,
        normal_median_px=float(np.median(across)) if enough else None,
        points=len(kept),
        tried=len(segments),
        similarity=ssim(match.image, model, match.usable),
        correlation=correlation(match.image, model, match.usable),
        xy_px=kept.xy_px,
        shift_px=shift,
        horizontal=kept.horizontal,
    )


def _mean(values: Array) -> float:
    return float(values.mean()) if values.size else 0.0


def usable_segments(segments: Segments, match: Match, model: Array, settings: ValidateSettings) -> Segments:
    """Lit segments wholly on usable pixels whose simulated step stands out of the noise."""
    lit = segments.chosen(segments.incidence_deg < settings.max_incidence_deg)
    origin = (match.simulation.window.x0, match.simulation.window.y0)
    usable = profiles(match.usable.astype(np.float64), lit, origin, settings.half_px)
    steps = profiles(model, lit, origin, settings.half_px)
    clear = (usable == 1).all(axis=1)
    sky = match.usable & (match.simulation.coverage < 1e-3)
    noise = 1.4826 * float(np.median(np.abs(match.image[sky] - np.median(match.image[sky])))) if sky.any() else 0.0
    return lit.chosen(clear & (np.nanmax(steps, axis=1) - np.nanmin(steps, axis=1) > settings.min_contrast * noise))


def edge_position(values: Array, segments: Segments, settings: ValidateSettings) -> Array:
    """Where the brightness falls fastest outward along each segment (n,), px from the nearest pixel of the crossing;
    parabola through the extremum of the smoothed derivative. NaN where the extremum is at an end."""
    from scipy.ndimage import gaussian_filter1d

    smooth = gaussian_filter1d(values, max(settings.smooth_px, 1e-3), axis=1, mode="nearest")
    outward = np.sign(np.where(segments.horizontal, segments.normal[:, 0], segments.normal[:, 1]))
    fall = -outward[:, None] * (smooth[:, 2:] - smooth[:, :-2]) / 2
    if fall.shape[0] == 0:
        return np.zeros(0)
    best = np.argmax(fall, axis=1)
    inner = np.clip(best, 1, fall.shape[1] - 2)
    rows = np.arange(len(fall))
    left, here, right = fall[rows, inner - 1], fall[rows, inner], fall[rows, inner + 1]
    curvature = left - 2 * here + right
    peak = np.divide(0.5 * (left - right), curvature, out=np.full_like(here, np.nan), where=curvature < 0)
    position = inner + 1 - settings.half_px + np.clip(peak, -1, 1)
    return np.where((best == inner) & (here > 0), position, np.nan)
