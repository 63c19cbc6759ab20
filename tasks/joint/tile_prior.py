"""How far the tiles' gains may be off: before anything is known, and as the image itself shows it."""

import numpy as np
from numpy.typing import NDArray

from tasks.joint.normal_equations import Fit
from tasks.joint.settings import TileSettings
from tasks.joint.tiles import GAINS, LOCAL

# 1-sigma of what is held.
HELD = 1e-9


def learned_prior(fit: Fit, before: NDArray, sectors: int, settings: TileSettings) -> NDArray[np.float64]:
    """Inverse variances (tiles, LOCAL) of the tiles' unknowns as the image itself shows them in a fit with those of
    `before`, along the limb and inside the disk apart; at most those of the settings.

    Their true variances by moments: with V their covariance after the fit and P their inverse variances before, the
    image's errors reach them as V - V P V, and what they truly are shrunk by K = 1 - V P. Where none of them shows more
    than chance they are held: an image that fits needs no tiles.
    """
    from scipy.optimize import nnls

    largest = np.maximum(settings.sigmas, HELD)
    limb = np.arange(len(before)) < sectors
    shrunk = np.eye(LOCAL) - fit.own_covariance * before[:, None, :]
    by_noise = np.einsum("tij,tji->ti", shrunk, fit.own_covariance)
    prior = np.empty_like(before)
    for part in (limb, ~limb):
        known = part & (fit.gain_information > settings.seen / largest[0] ** 2)
        sigma = largest
        if known.sum() >= settings.fewest:
            surplus = (fit.own[known] ** 2 - by_noise[known]).sum(axis=0)
            by_chance = settings.chance * np.sqrt(2 * (by_noise[known] ** 2).sum(axis=0))
            passed = (shrunk[known] ** 2).sum(axis=0)
            scale = np.sqrt(np.maximum(np.diag(passed), 1e-300))
            variance = nnls(passed / scale / scale[:, None], surplus / scale)[0] / scale
            sigma = settings.heavy_tail * np.sqrt(variance * bool((surplus > by_chance).any()))
            # An even veil looks much like a gain, but gains that change across tiles cannot be the same in all; nor is
            # there a preferred direction.
            sigma[1:GAINS] = sigma[1:GAINS].max()
            sigma[0] = sigma[:GAINS].max()
        prior[part] = 1 / np.clip(sigma, np.minimum(settings.smallest, largest), largest) ** 2
    return prior


def limb_gain(fit: Fit, before: NDArray, sectors: int, settings: TileSettings) -> float:
    """RMS of the gains of the sectors along the limb in a fit with the inverse variances `before` (tiles, LOCAL),
    beyond what noise makes them: what map and laws get wrong of the limb's brightness, relative. 0 where the image
    tells too few of them."""
    known = np.flatnonzero(fit.gain_information[:sectors] > settings.seen / max(settings.gain, HELD) ** 2)
    if len(known) < settings.fewest:
        return 0.0
    own, variance = fit.own[known, 0], fit.own_covariance[known, 0, 0]
    by_noise = variance * (1 - variance * before[known, 0])
    return float(np.sqrt(max(np.mean(own**2 - by_noise), 0.0)))


def first_prior(count: int, settings: TileSettings) -> NDArray[np.float64]:
    """Inverse variances (tiles, LOCAL) before anything is known."""
    sigma = np.maximum(settings.sigmas, HELD)
    return np.tile(1 / sigma**2, (count, 1))
