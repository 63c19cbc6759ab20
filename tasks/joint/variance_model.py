"""How far a model is trusted, learned from the residuals that it leaves: the weights of pixels and of tiles."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tasks.joint.cutout import Cutout
from tasks.joint.model import Model
from tasks.joint.normal_equations import Fit
from tasks.joint.settings import JointSettings
from tasks.joint.thresholds import VarianceThresholds
from tasks.joint.tile_prior import first_prior, learned_prior

Array = NDArray[np.float64]
Image = NDArray[np.float32]

MEDIAN_CHI2 = 0.455  # of one degree of freedom


@dataclass(frozen=True)
class VarianceModel:
    """relative: error of the model's brightness, 1-sigma. dusk: the same at the terminator, where laws and relief are
    trusted least. edge_px: error of places in the image. shared: how many
    neighbouring pixels of the disk err together. sky: the factor by which the sky's variance exceeds its noise's,
    pixels that err together included: scattered light and the like are in no model. tiles: (tiles, LOCAL) inverse
    variances of the tiles' unknowns."""

    relative: float
    dusk: float
    edge_px: float
    shared: float
    sky: float
    tiles: Array

    @classmethod
    def at_first(cls, model: Model, settings: JointSettings) -> "VarianceModel":
        """Before anything is known."""
        first = settings.thresholds.variance
        tiles = first_prior(model.tiles.count, settings.tiles)
        return cls(first.relative, first.dusk, settings.edge_px, 1.0, 1.0, tiles)

    def learned(self, model: Model, data: Cutout, weights: Array, fit: Fit, settings: JointSettings) -> "VarianceModel":
        """What the residuals of `fit`, made at the bases' `weights` (k,), say."""
        limits = settings.thresholds.variance
        bright = model.brightness(weights)
        noise = np.sqrt(data.variance)
        inside = (model.coverage > 0.99) & data.usable & (model.mu0 > 2 * settings.terminator)
        relative = self.relative
        if inside.sum() > limits.fewest_pixels:
            relative = _surplus(fit.residual[inside], noise[inside], bright[inside], limits.most_relative)
        relative = max(relative, limits.least_relative)
        steep = _steepness(model.picture(weights) if model.hides else bright)
        limb = (model.tiles.label >= 0) & (model.tiles.label < model.tiles.sectors) & data.usable
        edge = self.edge_px
        if limb.sum() > limits.fewest_pixels:
            limb &= steep > np.quantile(steep[limb], 1 - limits.steep_share)
            known = np.hypot(noise[limb], relative * bright[limb])
            edge = _surplus(fit.residual[limb], known, steep[limb], settings.edge_px)
        edge = max(edge, min(limits.least_edge_px, settings.edge_px))
        tiles = learned_prior(fit, self.tiles, model.tiles.sectors, settings.tiles)
        dusk = limits.dusk * min(1.0, float(tiles[-1, 0]) ** -0.5 / limits.dusk_gain)
        disk = model.tiles.label >= 0
        sky = _excess(fit.residual, data.variance, ~disk & data.usable, limits) * _shared(fit, ~disk, limits)
        return VarianceModel(relative, dusk, edge, _shared(fit, disk, limits), sky, tiles)

    def weight(self, model: Model, data: Cutout, weights: Array, settings: JointSettings) -> Image:
        """Inverse variance (ny, nx) of image minus model: noise, a relative error, places known to `edge_px`, and no
        trust near the terminator."""
        bright = model.brightness(weights)
        steep = _steepness(model.picture(weights) if model.hides else bright)
        variance = data.variance + (self.relative * bright) ** 2 + (self.edge_px * steep) ** 2
        if settings.terminator:
            variance = variance + (self.dusk * _at_dusk(model, data, bright, settings)) ** 2
        together = np.where(model.tiles.label >= 0, self.shared, self.sky)
        return np.where(data.usable, 1 / np.maximum(variance * together, 1e-12), 0).astype(np.float32)


def _at_dusk(model: Model, data: Cutout, bright: Image, settings: JointSettings) -> Image:
    """Brightness (ny, nx) that is not trusted: near the terminator, fading away from it."""
    inside = (model.coverage > 0.99) & data.usable
    typical = np.float32(np.percentile(bright[inside], 50) if inside.any() else 1.0)
    near = np.exp(-model.mu0 / np.float32(settings.terminator)) * (model.coverage > 0.5)
    return np.asarray(near * np.minimum(bright + 0.05 * typical, typical), np.float32)


def _excess(residual: Image, variance: Image, where: NDArray[np.bool_], limits: VarianceThresholds) -> float:
    """Robust mean square of residuals over their variance, at least 1."""
    if where.sum() <= limits.fewest_pixels:
        return 1.0
    return max(float(np.median(residual[where] ** 2 / np.maximum(variance[where], 1e-12))) / MEDIAN_CHI2, 1.0)


def _shared(fit: Fit, where: NDArray[np.bool_], limits: VarianceThresholds) -> float:
    """Mean square of the summed residuals of small blocks over the sum of their squares: 1 for independent pixels."""
    block = limits.block_px
    residual = np.where(where, fit.residual * np.sqrt(fit.weight), 0).astype(np.float64)
    ny, nx = (n // block * block for n in residual.shape)
    blocks = residual[:ny, :nx].reshape(ny // block, block, nx // block, block)
    squares = float((blocks**2).sum())
    return float(max((blocks.sum(axis=(1, 3)) ** 2).sum() / squares, 1.0)) if squares > 0 else 1.0


def _steepness(bright: Image) -> Image:
    """Size (ny, nx) of the brightness gradient, per pixel."""
    gradient_y, gradient_x = np.gradient(bright)
    return np.hypot(gradient_x, gradient_y)


def _surplus(residual: NDArray, noise: NDArray, size: NDArray, most: float) -> float:
    """Share (0 to `most`) of `size` by which residuals are off beyond their noise, 1-sigma: with it half of their
    squares lie above the median of chi square, and for each pixel the share that brings it there is known."""
    square = (residual**2 / MEDIAN_CHI2 - noise**2) / np.maximum(size**2, 1e-12)
    return float(min(np.sqrt(max(np.median(square), 0.0)), most))
