"""One region's photometry: brightness by phase, residuals by angle and place, McEwen's limb weight by image."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from tasks.photometry.each_image import ImageLimbWeight
from tasks.photometry.fit import PhotometricFit
from tasks.photometry.region import RegionPixels
from tasks.pictures.canvas import BLUE, ORANGE, RED, bare, canvas

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BINS = 12


def photometry_figure(
    name: str, pixels: RegionPixels, fit: PhotometricFit, each: Sequence[ImageLimbWeight]
) -> "Figure":
    """Six panels: brightness of image and law by phase; residuals by incidence, emission and phase; their map; L of
    each image."""
    figure, panels = canvas(2, 3, (4.6, 3.3))
    _brightness(panels[0], pixels, fit)
    for panel, label, cosine in ((panels[1], "incidence", pixels.mu0), (panels[2], "emission", pixels.mu)):
        _residuals(panel, np.degrees(np.arccos(np.clip(cosine, -1, 1))), fit, label)
    _residuals(panels[3], pixels.phase_deg, fit, "phase")
    _residual_map(panels[4], pixels, fit)
    _limb_weights(panels[5], pixels, fit, each)
    count = len(pixels.products)
    figure.suptitle(
        f"{name}: {fit.law}, {count} image{'s' if count > 1 else ''}, {len(pixels.value)} pixels", fontsize=11
    )
    return figure


def _brightness(panel: "Axes", pixels: RegionPixels, fit: PhotometricFit) -> None:
    """Median over each image of brightness / factor, with the middle 68 %."""
    phases = [pixels.mean_phase_deg(i) for i in range(len(pixels.products))]
    factor = fit.calibration[pixels.image]
    for values, label, color, marker, shift in (
        (pixels.value / factor, "image", BLUE, "o", -0.4),
        (fit.model / factor, "law", ORANGE, "s", 0.4),
    ):
        low, middle, high = np.array(
            [np.percentile(values[pixels.image == i], (16, 50, 84)) for i in range(len(phases))]
        ).T
        panel.errorbar(
            np.array(phases) + shift, middle, (middle - low, high - middle), label=label, color=color, marker=marker,
            linestyle="", markersize=5, capsize=2,
        )  # fmt: skip
    panel.set_ylim(bottom=0)
    panel.set_xlabel("phase, deg")
    panel.set_ylabel("brightness / factor of image")
    panel.legend(frameon=False, fontsize=8)
    panel.set_title("median and middle 68 % of the pixels", fontsize=9)
    bare(panel)


def _residuals(panel: "Axes", angle_deg: np.ndarray, fit: PhotometricFit, label: str) -> None:
    percent = 100 * fit.residual
    reach = max(float(np.percentile(np.abs(percent), 99)), 1.0)
    panel.hexbin(angle_deg, np.clip(percent, -reach, reach), gridsize=40, cmap="cividis", mincnt=1, linewidths=0.1)
    edges = np.linspace(angle_deg.min(), angle_deg.max() + 1e-6, BINS + 1)
    which = np.digitize(angle_deg, edges) - 1
    filled = [k for k in range(BINS) if (which == k).sum() >= 10]
    medians = [float(np.median(percent[which == k])) for k in filled]
    panel.plot((edges[:-1] + edges[1:])[filled] / 2, medians, color=RED, marker="o", markersize=4, label="median")
    panel.axhline(0, color="black", linewidth=0.8, linestyle=":")
    panel.set_xlabel(f"{label}, deg")
    panel.set_ylabel("image minus law, %")
    panel.legend(fontsize=8, framealpha=0.9)
    bare(panel)


def _residual_map(panel: "Axes", pixels: RegionPixels, fit: PhotometricFit) -> None:
    """Mean residual over the images, by place: what of the ground no law explains, markings first of all."""
    if pixels.latitude is None or pixels.longitude is None:
        panel.set_axis_off()
        return
    percent = 100 * fit.residual
    reach = max(float(np.percentile(np.abs(percent), 95)), 1.0)
    middle = float(np.degrees(np.angle(np.exp(1j * np.radians(pixels.longitude)).mean())))
    east = (pixels.longitude - middle + 180) % 360 - 180 + middle  # a region through longitude 0 stays in one piece
    cells = panel.hexbin(
        east, pixels.latitude, C=percent, gridsize=45, cmap="RdBu_r", vmin=-reach, vmax=reach, linewidths=0.1
    )
    panel.figure.colorbar(cells, ax=panel, label="image minus law, %")
    panel.set_xlabel("east longitude, deg")
    panel.set_ylabel("latitude, deg")
    bare(panel)


def _limb_weights(panel: "Axes", pixels: RegionPixels, fit: PhotometricFit, each: Sequence[ImageLimbWeight]) -> None:
    known = [(pixels.mean_phase_deg(i), w.value, w.sigma) for i, w in enumerate(each) if w.value is not None]
    if known:
        phase, value, sigma = np.array(known, np.float64).T
        panel.errorbar(phase, value, sigma, marker="o", linestyle="", color=BLUE, capsize=2, label="each image alone")
    if fit.law == "lunar-lambert":
        line = np.linspace(float(pixels.phase_deg.min()), float(pixels.phase_deg.max()), 50)
        values = fit.values["limb_weight"] + fit.values["limb_weight_per_deg"] * line
        panel.plot(line, values, color=ORANGE, linestyle="--", label="all together")
    panel.set_xlabel("phase, deg")
    panel.set_ylabel("L, share of Lommel-Seeliger")
    if known or fit.law == "lunar-lambert":
        panel.legend(frameon=False, fontsize=8)
    bare(panel)
