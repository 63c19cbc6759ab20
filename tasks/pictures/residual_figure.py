"""Image, simulation and what is left, under the predicted and the corrected pose."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from catalog.errors import FailedError
from catalog.pose import Pose
from catalog.reasons import Reason
from tasks.compare.brightness import fit_brightness
from tasks.compare.match import framed_window, match_scene
from tasks.pictures.canvas import GAMMA, SKY, YELLOW, canvas
from tasks.pictures.product import Product
from tasks.project.curves import limb_points
from tasks.simulate.window import Window

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LIMB_POINTS = 360
LARGEST_RESIDUAL = 0.3  # of the disk's bright parts
MARGIN_PX = 12.0


@dataclass(frozen=True)
class Residual:
    """Under one pose: image, model (ny, nx), residual relative to the bright parts of the disk, NaN where the image
    cannot be used; the limb (m, 2); rms of the residual."""

    image: NDArray[np.float64]
    model: NDArray[np.float64]
    relative: NDArray[np.float64]
    origin: tuple[int, int]
    limb_px: NDArray[np.float64]

    @property
    def rms(self) -> float:
        """RMS of the relative residual."""
        return float(np.sqrt(np.nanmean(self.relative**2)))


def residual_of(product: Product, pose: Pose) -> Residual | None:
    """Simulate `pose` under the corrected pose's window, with the brightness that fits best; None when its target is
    nowhere near."""
    scene = product.scene
    window = framed_window(scene, product.after, MARGIN_PX)
    if not _sees(pose, product, window):
        return None
    try:
        match = match_scene(product.observation, scene, pose, window)
        model, _ = fit_brightness(match, match.simulation.bases)
    except FailedError:
        return None
    bright = float(np.percentile(match.image[match.usable], 98)) - float(np.percentile(match.image[match.usable], 2))
    relative = np.where(match.usable, (match.image - model) / max(bright, 1e-12), np.nan)
    limb = limb_points(pose, scene.camera, scene.target, LIMB_POINTS)
    image = match.image.astype(np.float64)
    if match.behind is not None:
        image, model = image + match.behind.light, model + match.behind.light
    return Residual(image, model, relative, match.origin, limb)


def residual_figure(product: Product) -> "Figure":
    """A row for the corrected pose and one for the predicted one, if its target is in the picture: image with the limb,
    simulation, residual in per cent of the disk's bright parts."""
    after = residual_of(product, product.after)
    if after is None:
        raise FailedError(Reason.NO_USABLE_PIXELS, f"no usable pixel of {product.name} shows the target.")
    before = residual_of(product, product.before)
    rows = [("corrected", after, SKY)] + ([("predicted", before, YELLOW)] if before else [])
    figure, panels = canvas(len(rows), 3, (3.6, 3.3))
    for row, (name, found, colour) in enumerate(rows):
        three = panels[3 * row : 3 * row + 3]
        scale = np.nanpercentile(found.model, 1), np.nanpercentile(found.model, 99.7)
        for panel, values, title in ((three[0], found.image, "image"), (three[1], found.model, "simulation")):
            _show(panel, values, found, scale)
            panel.set_title(f"{title}, {name} pose", fontsize=9)
        three[0].plot(*_closed(found.limb_px), color=colour, linewidth=1.0, linestyle="-" if row == 0 else "--")
        _frame(three[0], found)
        reach = 100 * float(np.clip(np.nanpercentile(np.abs(found.relative), 99.5), 0.01, LARGEST_RESIDUAL))
        shown = three[2].imshow(100 * found.relative, cmap="PuOr", vmin=-reach, vmax=reach, extent=_extent(found),
                                interpolation="nearest")  # fmt: skip
        three[2].set_facecolor("0.6")
        three[2].set_title(f"image minus simulation, {100 * found.rms:.1f} % rms", fontsize=9)
        figure.colorbar(shown, ax=three[2], label="% of bright parts", shrink=0.85, extend="both")
    for panel in panels:
        panel.tick_params(labelsize=7)
    lost = "" if before else " (the predicted pose has the target elsewhere)"
    figure.suptitle(f"{product.name}{lost}", fontsize=11)
    return figure


def _sees(pose: Pose, product: Product, window: Window) -> bool:
    limb = limb_points(pose, product.scene.camera, product.scene.target, LIMB_POINTS)
    inside = (limb[:, 0] > window.x0) & (limb[:, 0] < window.x1) & (limb[:, 1] > window.y0) & (limb[:, 1] < window.y1)
    return bool(np.isfinite(limb).all() and inside.mean() > 0.3)


def _show(panel: "Axes", values: NDArray, found: Residual, scale: tuple[float, float]) -> None:
    shown = np.clip((values - scale[0]) / max(scale[1] - scale[0], 1e-12), 0, 1) ** GAMMA
    panel.imshow(shown, cmap="gray", vmin=0, vmax=1, extent=_extent(found), interpolation="nearest")


def _extent(found: Residual) -> tuple[float, float, float, float]:
    ny, nx = found.image.shape
    x, y = found.origin
    return x - 0.5, x + nx - 0.5, y + ny - 0.5, y - 0.5


def _frame(panel: "Axes", found: Residual) -> None:
    x0, x1, y1, y0 = _extent(found)
    panel.set_xlim(x0, x1)
    panel.set_ylim(y1, y0)


def _closed(xy: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.vstack([xy, xy[:1]]).T
