"""The target's outline in a frame: of the disks that may be it, the one whose limb and shading are those of a lit
body before a dark sky."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.errors import RefusedError
from catalog.observation import Observation
from catalog.reasons import Reason
from catalog.target import Target
from tasks.initial_pose.disk import Disk, find_disks, lit_outside
from tasks.initial_pose.edges import Edges, edges_of, values_at
from tasks.initial_pose.limb import Limb, limb_along
from tasks.initial_pose.settings import LimbSearchSettings
from tasks.initial_pose.sun import SunInDisk, sun_of_disk

Array = NDArray[np.float64]

CANDIDATES = 10
CRESCENT_PX = 3  # of thinner ones both sides of an edge are sky (`edge_weights`)
# Limb and light are found in turn so often, where the terminator lies farther inside the limb than so many pixels;
# what is no likeness at all is not looked at again.
ROUNDS, ROUND_PX, LIKE_NONE = 2, 0.2, 0.5
# Where the terminator is nowhere farther inside the limb than this share of the radius, the edge all round the disk is
# nearly the limb's.
NEARLY_FULL = 0.1
# Half an ellipse that is that much inside the limb moves the centre by so many times that (Lommel-Seeliger, 10 to 24
# deg of phase, its phase found to some degrees: 1.3 to 3 times).
TERMINATOR_TIMES = 2.0
# Of less of a sunlit limb the edge all round the disk says more.
SHORT_DEG = 45.0
# Of another disk that is as good as this share of the best, the target may be either.
RIVAL_SHARE = 0.5
REMEDY = (
    "--pose image needs about a quarter of one body's limb or more in the frame, on its sunlit side and before a dark "
    "sky. Give a pose file (--pose FILE), or kernels that know the geometry."
)


@dataclass(frozen=True)
class Outline:
    """limb, sun: of the disk. quality: of the disk among others. lit_share: how much of the lit limb within the frame
    is seen as an edge. sky_share: brightness of the sky beside the disk, as a share of the disk's. outside: share of a
    ring around it that is lit."""

    limb: Limb
    sun: SunInDisk
    quality: float
    lit_share: float
    sky_share: float
    outside: float


@dataclass(frozen=True)
class Found:
    """outline: of the target. rival: another disk in the frame that is nearly as good; None where there is none."""

    outline: Outline
    rival: Outline | None


def find_outline(
    observation: Observation, target: Target, settings: LimbSearchSettings, radius_px: float | None = None
) -> Found:
    """The outline of the target anywhere in the frame. radius_px: of its disk, where the range is known; a short arc
    then tells the centre.

    Raises RefusedError `no-limb` where no edge in the frame is the limb of a body, `limb-too-short` where what is seen
    of it leaves its radius unknown.
    """
    edges = edges_of(observation, settings.edge_sigmas)
    disks = candidates(find_disks(edges, settings, radius_px))
    outlines = [each for disk in disks if (each := outline_of(edges, disk, target, radius_px))]
    outlines.sort(key=lambda each: -each.quality)
    least_deg = settings.arc_deg if radius_px is None else settings.known_arc_deg
    least_share = settings.disk_share if radius_px is None else 0.0
    borne_out = [
        each for each in outlines if is_borne_out(each, least_deg, settings) and each.sun.disk_share >= least_share
    ]
    if not borne_out:
        short = next((each for each in outlines if is_lit_disk(each, settings)), None)
        raise limb_missing(short, least_deg, settings)
    best = borne_out[0]
    others = [each for each in borne_out[1:] if is_apart(each, best) and each.quality > RIVAL_SHARE * best.quality]
    return Found(best, others[0] if others else None)


def candidates(disks: list[Disk]) -> list[Disk]:
    """The disks that are looked at: those of which the longest limb is seen, and those of which the largest share of
    their limb is; without these a small disk is lost among the longer edges of a frame."""
    by_share = sorted(disks[CANDIDATES:], key=lambda disk: -disk.score / disk.radius_px)
    return [*disks[:CANDIDATES], *by_share[:CANDIDATES]]


def outline_of(edges: Edges, disk: Disk, target: Target, radius_px: float | None = None) -> Outline | None:
    """The outline near a disk; None where there is no limb, or too little of disk and sky."""
    limb = limb_along(edges, disk, target, None, radius_px)
    sun = None if limb is None else sun_of_disk(edges, limb)
    nearly_full = False
    for _ in range(ROUNDS):
        if limb is None or sun is None:
            return None
        if limb.mean_px * (1 - np.cos(np.radians(sun.phase_deg))) < ROUND_PX or sun.likeness < LIKE_NONE:
            break
        whole, inside_px = limb, limb.mean_px * (1 - np.cos(np.radians(sun.phase_deg)))
        limb = limb_along(edges, Disk(limb.centre_px, limb.mean_px, disk.score), target, sun.azimuth_deg, radius_px)
        if (limb is None or limb.arc_deg < SHORT_DEG) and inside_px < NEARLY_FULL * whole.mean_px:
            # The sunlit half lies outside the frame: what is seen is the terminator, no more than that inside the limb.
            limb, nearly_full = whole.with_error(TERMINATOR_TIMES * inside_px, inside_px), True
            break
        sun = None if limb is None else sun_of_disk(edges, limb)
    if limb is None or sun is None:
        return None
    outside = lit_outside(edges, limb.centre_px, limb.mean_px)
    lit, sky = lit_share(edges, limb, None if nearly_full else sun), sky_share(edges, limb, sun)
    length = limb.mean_px * np.radians(limb.arc_deg)
    quality = float(length * max(sun.likeness, 0.0) ** 4 * lit * max(1 - outside, 0.0))
    return Outline(limb, sun, quality, lit, sky, outside)


def is_lit_disk(outline: Outline, settings: LimbSearchSettings) -> bool:
    """Whether an outline looks like a lit body before a dark sky, however little of its limb is seen."""
    return (
        outline.sun.likeness >= settings.likeness
        and outline.lit_share >= settings.lit_share
        and outline.sky_share <= settings.sky_share
        and outline.outside <= settings.ring_share
    )


def is_borne_out(outline: Outline, least_deg: float, settings: LimbSearchSettings) -> bool:
    """Whether an outline is a lit body's before a dark sky, at least so many degrees of it are seen, and its radius is
    known."""
    enough = outline.limb.arc_deg >= least_deg and outline.limb.arc_sigma <= settings.radius_sigma
    return enough and is_lit_disk(outline, settings)


def is_apart(outline: Outline, other: Outline) -> bool:
    """Whether two outlines are of bodies of which neither covers the other's middle."""
    apart = float(np.hypot(*(outline.limb.centre_px - other.limb.centre_px)))
    return apart > max(outline.limb.semi_px, other.limb.semi_px)


def lit_share(edges: Edges, limb: Limb, sun: SunInDisk | None) -> float:
    """How much of the limb's sunlit half (sun None: of all of it) within the frame, on pixels that have a value, was
    seen as an edge."""
    bins = np.radians(np.arange(0.0, 360.0, 5.0) + 2.5)
    lit = np.full(len(bins), True) if sun is None else np.cos(bins - np.radians(sun.azimuth_deg)) > 0.2
    x = limb.centre_px[0] + limb.mean_px * np.cos(bins)
    y = limb.centre_px[1] + limb.mean_px * np.sin(bins)
    ny, nx = edges.clean.shape
    inside = (x >= 4) & (y >= 4) & (x <= nx - 5) & (y <= ny - 5)
    inside &= values_at(edges.usable.astype(np.float32), x, y) > 0.99
    away = limb.points_px - limb.centre_px
    seen = np.zeros(len(bins), bool)
    seen[(np.degrees(np.arctan2(away[:, 1], away[:, 0])) % 360 / 5).astype(int) % len(bins)] = True
    wanted = lit & inside
    return float((seen & wanted).sum() / wanted.sum()) if wanted.any() else 0.0


def sky_share(edges: Edges, limb: Limb, sun: SunInDisk) -> float:
    """Brightness outside the seen limb, above the frame's darkest parts, as a share of that inside."""
    away = limb.points_px - limb.centre_px
    away = away / np.maximum(np.linalg.norm(away, axis=1), 1e-9)[:, None]
    outside_px = max(4.0, 0.05 * limb.mean_px)
    # Of a crescent no farther inside than its middle.
    inside_px = min(outside_px, 0.5 * limb.mean_px * (1 + np.cos(np.radians(sun.phase_deg))))
    outside, inside = (
        values_at(edges.clean, *(limb.points_px + beside * away).T) - edges.dark for beside in (outside_px, -inside_px)
    )
    return float(np.median(outside) / max(float(np.median(inside)), 1e-12))


def limb_missing(short: Outline | None, least_deg: float, settings: LimbSearchSettings) -> RefusedError:
    """Why no outline is known. short: a lit disk of whose limb too little is seen; least_deg: what is needed of it."""
    if short is None:
        return RefusedError(
            Reason.NO_LIMB,
            "no edge of brightness in the frame is the limb of a lit body before a dark sky (disks of less than "
            f"{2 * settings.least_radius_px:g} px and crescents thinner than {CRESCENT_PX} px are not looked for).",
            REMEDY,
        )
    limb, share = short.limb, short.sun.disk_share
    return RefusedError(
        Reason.LIMB_TOO_SHORT,
        f"only {limb.arc_deg:.0f} deg of a limb are seen, of a disk some {2 * limb.mean_px:.0f} px across ({share:.0%} "
        f"of it in the frame); their scatter leaves its radius to {limb.arc_sigma:.1%} (needed: {least_deg:g} deg, "
        f"{settings.disk_share:.0%} and {settings.radius_sigma:.0%}; with a range from kernels "
        f"{settings.known_arc_deg:g} deg).",
        REMEDY,
    )
