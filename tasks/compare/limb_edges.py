"""Where image and simulation have the edge of the lit limb, segment by segment (paper, section 4.2)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from catalog.robust import sigma_about_median
from tasks.compare.brightness import fit_brightness
from tasks.compare.match import Match
from tasks.compare.segments import Segments, limb_segments, profiles
from tasks.simulate.window import disk_radius_px

Array = NDArray[np.float64]
# A limb within this cosine of the sub-solar side counts as fully lit, however low the Sun stands there.
LIT_SIDE_COSINE = 0.6
# A disk whose terminator is this near its limb is round: all of the limb is seen.
ROUND_PX = 0.25
# Where too little of a lit limb is in the frame, one whose terminator is this near is measured all round instead: the
# Sun's own error of 2 deg moves such an edge by less (R sin(phase) 2 deg: 0.3 px of 110 px radius at 4 deg).
NEARLY_ROUND_PX = 0.5
# How a limb steps is measured on so many pixels on each side of it. In front of a bright body it may be as bright as
# that; where less than this share of what the brightness changes along a segment is at the limb, its edge is another's
# (measured on moons as bright as the planet behind: edges are 0.1 px off above, 0.3 to 1 px below).
STEP_PX, STEP_SHARE = 3, 0.7
# Rows and columns cross a circle at 4 sqrt(2) places per pixel of its radius, each where the other does less steeply.
SEGMENTS_PER_RADIUS, SHARE_NEEDED, FEWEST_POINTS = 5.66, 0.25, 6


class LimbSettings(BaseModel):
    """half_px: reach of a segment to each side. smooth_px: Gaussian width of the derivative. max_incidence_deg: only
    limb points better lit than this, or on the sub-solar side when the phase angle is low, or all of them when it is so
    low that no dark rim shows. min_contrast: a segment's
    simulated step, in sigmas of the noise."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    half_px: int = Field(8, ge=3)
    smooth_px: float = Field(1.0, ge=0)
    max_incidence_deg: float = Field(80.0, gt=0, le=90)
    min_contrast: float = Field(5.0, ge=0)
    min_points: int = Field(16, ge=3)

    def points_needed(self, radius_px: float) -> int:
        """How many segments a limb must have been measured on: min_points, or a quarter of those of the whole limb
        where a disk of radius_px is too small to have so many."""
        return min(self.min_points, max(FEWEST_POINTS, int(np.ceil(SHARE_NEEDED * SEGMENTS_PER_RADIUS * radius_px))))


@dataclass(frozen=True)
class LimbEdges:
    """segments: those measured (n). shift_px: (n,) image minus simulation along each segment. tried: how many lit
    segments lay on usable pixels. model: the fitted simulation (ny, nx)."""

    segments: Segments
    shift_px: Array
    tried: int
    model: Array

    @property
    def across_px(self) -> Array:
        """The shifts' part across the limb, outward (n,)."""
        normal = self.segments.normal
        return self.shift_px * np.where(self.segments.horizontal, normal[:, 0], normal[:, 1])


def measure_limb(match: Match, settings: LimbSettings) -> LimbEdges:
    """Shift of the derivative's extremum between image and simulation on every segment across the lit limb."""
    model, _ = fit_brightness(match, match.simulation.bases)
    return edges_between(match, model, settings)


def edges_between(match: Match, model: Array, settings: LimbSettings) -> LimbEdges:
    """The same against any picture of the simulation, `model` (ny, nx)."""
    segments = usable_segments(limb_segments(match.pose, match.scene), match, model, settings)
    image, simulation = (
        profiles(picture, segments, match.origin, settings.half_px)
        for picture in (match.image.astype(np.float64), model)
    )
    if match.simulation.hides:
        # In front of a bright body the limb may be a step up.
        sign = np.where(fall_outward(simulation, segments) > 0, 1.0, -1.0)[:, None]
        image, simulation = sign * image, sign * simulation
    seen, simulated = (edge_position(values, segments, settings) for values in (image, simulation))
    shift = seen - simulated
    measured = np.isfinite(shift)
    return LimbEdges(segments.chosen(measured), shift[measured], len(segments), model)


def terminator_px(phase_deg: float, radius_px: float) -> float:
    """How far inside the limb the terminator of a disk is at most, pixels; inf of half a disk and less."""
    return radius_px * (1 - np.cos(np.radians(phase_deg))) if phase_deg < 90 else np.inf


def lit_limit_deg(phase_deg: float, settings: LimbSettings, radius_px: float = np.inf) -> float:
    """Largest incidence of a limb point that is compared; 180, all of them, where the terminator of a disk of radius_px
    is nowhere farther than ROUND_PX inside the limb."""
    if np.isfinite(radius_px) and terminator_px(phase_deg, radius_px) <= ROUND_PX:
        return 180.0
    sub_solar_side = 90 - np.degrees(np.arcsin(LIT_SIDE_COSINE * np.sin(np.radians(min(phase_deg, 90.0)))))
    return float(max(settings.max_incidence_deg, min(sub_solar_side, 89.5)))


def usable_segments(segments: Segments, match: Match, model: Array, settings: LimbSettings) -> Segments:
    """Lit segments that stand out; where they are too few and the terminator is nearly the limb, those all round."""
    radius_px = disk_radius_px(match.pose, match.scene.camera, match.scene.target)
    phase_deg = match.pose.phase_deg
    lit = segments.chosen(segments.incidence_deg < lit_limit_deg(phase_deg, settings, radius_px))
    found = standing_out(lit, match, model, settings)
    if len(found) < settings.points_needed(radius_px) and terminator_px(phase_deg, radius_px) <= NEARLY_ROUND_PX:
        return standing_out(segments, match, model, settings)
    return found


def standing_out(lit: Segments, match: Match, model: Array, settings: LimbSettings) -> Segments:
    """Segments wholly on usable pixels whose simulated step stands out of the noise."""
    usable = profiles(match.known.astype(np.float64), lit, match.origin, settings.half_px)
    steps = profiles(model, lit, match.origin, settings.half_px)
    clear = (usable == 1).all(axis=1)
    lit, steps = lit.chosen(clear), steps[clear]
    if len(lit) == 0:
        return lit
    sky = match.usable & (match.simulation.coverage < 1e-3)
    noise = sigma_about_median(match.image[sky]) if sky.any() else 0.0
    span = steps.max(axis=1) - steps.min(axis=1)
    clear = span > settings.min_contrast * noise
    if match.simulation.hides:
        clear &= np.abs(fall_outward(steps, lit)) > STEP_SHARE * span
    return lit.chosen(clear)


def fall_outward(values: Array, segments: Segments) -> Array:
    """By how much the brightness (n, 2*half+1) of a simulation falls across the limb, outward (n,)."""
    half = values.shape[1] // 2
    outward = np.sign(np.where(segments.horizontal, segments.normal[:, 0], segments.normal[:, 1]))
    before, after = values[:, half - STEP_PX : half], values[:, half + 1 : half + 1 + STEP_PX]
    return np.asarray(outward * (before.mean(axis=1) - after.mean(axis=1)))


def edge_position(values: Array, segments: Segments, settings: LimbSettings) -> Array:
    """Where the brightness falls fastest outward along each segment (n,), px from the nearest pixel of the crossing;
    parabola through the extremum of the smoothed derivative. NaN where the extremum is at an end."""
    from scipy.ndimage import gaussian_filter1d

    if len(segments) == 0:
        return np.zeros(0)
    smooth = gaussian_filter1d(values, max(settings.smooth_px, 1e-3), axis=1, mode="nearest")
    outward = np.sign(np.where(segments.horizontal, segments.normal[:, 0], segments.normal[:, 1]))
    fall = -outward[:, None] * (smooth[:, 2:] - smooth[:, :-2]) / 2
    best = np.argmax(fall, axis=1)
    inner = np.clip(best, 1, fall.shape[1] - 2)
    rows = np.arange(len(fall))
    left, here, right = fall[rows, inner - 1], fall[rows, inner], fall[rows, inner + 1]
    curvature = left - 2 * here + right
    peak = np.divide(0.5 * (left - right), curvature, out=np.full_like(here, np.nan), where=curvature < 0)
    position = inner + 1 - settings.half_px + np.clip(peak, -1, 1)
    return np.where((best == inner) & (here > 0), position, np.nan)
