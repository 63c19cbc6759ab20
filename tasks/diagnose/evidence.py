"""How much better one explanation fits the image than another one, and than chance.

Explanations are compared over the same pixels: those of both disks and a rim of sky. Errors of neighbouring pixels go
together, so that a disk has fewer independent pixels than pixels.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.flips import flipped
from catalog.observation import Observation
from catalog.pose import Pose
from tasks.compare.brightness import fit_brightness
from tasks.compare.match import framed_window, match_scene
from tasks.compare.reduce import reduced_observation, reduced_scene
from tasks.diagnose.candidates import BACK, Candidate
from tasks.point.coarse import lit_width_px, without_specks
from tasks.simulate import Scene
from tasks.simulate.window import disk_radius_px

Image = NDArray[np.float64]
ACROSS = 120.0
RIM_PX, RIM_RADII = 4.0, 0.3
# Sides of the blocks in which errors go together, of the reduced picture.
BLOCK_PX = 8
FEWEST_PIXELS = 50
LEAST_SHARED = 0.5


@dataclass(frozen=True)
class Fit:
    """All (ny, nx) of the reduced frame as it was taken: residual, image minus simulation, and sky, image minus the sky
    around the target, as if none were there; both NaN where the candidate's image is not usable. near: disk and rim."""

    residual: Image
    sky: Image
    near: NDArray[np.bool_]


def fit_of(candidate: Candidate, observation: Observation, pose: Pose, scene: Scene, n: int) -> Fit:
    """Of a candidate whose picture is `observation`, settled at `pose`, over cells of n x n pixels."""
    seen = reduced_observation(without_specks(observation, lit_width_px(pose, scene)), n)
    small = reduced_scene(candidate.seen_by(scene), n)
    margin = RIM_PX + RIM_RADII * disk_radius_px(pose, small.camera, small.target)
    match = match_scene(seen, small.coarser(pose, ACROSS), pose, framed_window(small, pose, margin))
    model, coefficients = fit_brightness(match, match.simulation.bases)
    window = match.simulation.window
    usable = seen.usable
    image = np.where(usable, seen.image, np.nan).astype(np.float64)
    ny, nx = image.shape
    inside = window.clipped((nx, ny))
    place = np.s_[inside.y0 : inside.y1, inside.x0 : inside.x1]
    part = np.s_[inside.y0 - window.y0 : inside.y1 - window.y0, inside.x0 - window.x0 : inside.x1 - window.x0]
    near = np.zeros(image.shape, bool)
    near[place] = True
    around = near & usable
    around[place] &= match.simulation.coverage[part] < 1e-3
    level = float(np.median(image[around])) if around.any() else float(coefficients[-1])
    sky = image - level
    residual = sky.copy()
    residual[place] = image[place] - model[part]
    if candidate.flip:
        residual, sky, near = (flipped(a, BACK.get(candidate.flip, candidate.flip)) for a in (residual, sky, near))
    return Fit(residual, sky, near)


def better_by(fit: Fit, other: Fit) -> tuple[float, float]:
    """How many times as large the other one's mean square is, and the gain in log-likelihood that this is worth, over
    pixels that both have. Where the other one has few of those, such as behind a mask, it explains nothing of them."""
    meant = (fit.near | other.near) & np.isfinite(fit.residual)
    both = meant & np.isfinite(other.residual)
    if np.count_nonzero(both & fit.near) >= LEAST_SHARED * np.count_nonzero(meant & fit.near):
        meant = both
    base = np.where(np.isfinite(other.residual), other.residual, fit.sky)
    return ratio_and_gain(np.where(meant, fit.residual, 0), np.where(meant, base, 0), meant)


def better_than_sky(fit: Fit) -> tuple[float, float]:
    """The same against a frame without a target."""
    meant = fit.near & np.isfinite(fit.residual)
    return ratio_and_gain(np.where(meant, fit.residual, 0), np.where(meant, fit.sky, 0), meant)


def ratio_and_gain(residual: Image, base: Image, meant: NDArray[np.bool_]) -> tuple[float, float]:
    """Of two residuals (ny, nx), 0 outside `meant`: ratio of the mean squares, and n/2 times its logarithm with n the
    number of independent pixels."""
    count, squares = int(np.count_nonzero(meant)), float((residual**2).sum())
    if count < FEWEST_PIXELS or squares <= 0:
        return 1.0, 0.0
    ratio = float((base**2).sum()) / squares
    return ratio, 0.5 * count / shared(residual) * float(np.log(max(ratio, 1e-12)))


def shared(residual: Image) -> float:
    """How many pixels err together: mean square of the sums over blocks by that of single pixels, 1 at least."""
    ny, nx = (-(-size // BLOCK_PX) * BLOCK_PX for size in residual.shape)
    padded = np.zeros((ny, nx))
    padded[: residual.shape[0], : residual.shape[1]] = residual
    blocks = padded.reshape(ny // BLOCK_PX, BLOCK_PX, nx // BLOCK_PX, BLOCK_PX).sum(axis=(1, 3))
    squares = float((residual**2).sum())
    return max(float((blocks**2).sum()) / squares, 1.0) if squares > 0 else 1.0
