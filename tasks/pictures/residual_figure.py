"""Image, simulation and what is left, under the predicted and the corrected pose."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.errors import FailedError
from catalog.pose import Pose
from catalog.reasons import Reason
from tasks.compare.brightness import fit_brightness
from tasks.compare.match import framed_window, match_scene
from tasks.pictures.canvas import GAMMA, SKY, YELLOW
from tasks.pictures.product import Product
from tasks.pictures.sheet import Bar, Curve, Extent, Pixels, Sheet, coloured
from tasks.project.curves import limb_points
from tasks.simulate.window import Window

LIMB_POINTS = 360
LARGEST_RESIDUAL = 0.3  # of the disk's bright parts
MARGIN_PX = 12.0
CELL_PX = (396, 363)
GREY = (153, 153, 153)


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


def residual_figure(product: Product) -> Sheet:
    """A row for the corrected pose and one for the predicted one, if its target is in the picture: image with the limb,
    simulation, residual in per cent of the disk's bright parts."""
    after = residual_of(product, product.after)
    if after is None:
        raise FailedError(Reason.NO_USABLE_PIXELS, f"no usable pixel of {product.name} shows the target.")
    before = residual_of(product, product.before)
    rows = [("corrected", after, SKY)] + ([("predicted", before, YELLOW)] if before else [])
    lost = "" if before else " (the predicted pose has the target elsewhere)"
    sheet = Sheet(len(rows), 3, CELL_PX, f"{product.name}{lost}")
    for row, (name, found, colour) in enumerate(rows):
        extent = _extent(found)
        scale = np.nanpercentile(found.model, 1), np.nanpercentile(found.model, 99.7)
        limb = Curve(np.vstack([found.limb_px, found.limb_px[:1]]), colour, dashed=row > 0)
        sheet.panel(3 * row, _grey(found.image, scale), extent, f"image, {name} pose", curves=[limb])
        sheet.panel(3 * row + 1, _grey(found.model, scale), extent, f"simulation, {name} pose")
        reach = 100 * float(np.clip(np.nanpercentile(np.abs(found.relative), 99.5), 0.01, LARGEST_RESIDUAL))
        bar = Bar(-reach, reach, "PuOr", (True, True), "%")
        title = f"image - simulation, {100 * found.rms:.1f} % rms of bright parts"
        sheet.panel(3 * row + 2, coloured(100 * found.relative, bar, GREY), extent, title, bar)
    return sheet


def _sees(pose: Pose, product: Product, window: Window) -> bool:
    limb = limb_points(pose, product.scene.camera, product.scene.target, LIMB_POINTS)
    inside = (limb[:, 0] > window.x0) & (limb[:, 0] < window.x1) & (limb[:, 1] > window.y0) & (limb[:, 1] < window.y1)
    return bool(np.isfinite(limb).all() and inside.mean() > 0.3)


def _grey(values: NDArray, scale: tuple[float, float]) -> Pixels:
    shown = np.clip((values - scale[0]) / max(scale[1] - scale[0], 1e-12), 0, 1) ** GAMMA
    return np.repeat((255 * np.nan_to_num(shown)).astype(np.uint8)[..., None], 3, axis=2)


def _extent(found: Residual) -> Extent:
    ny, nx = found.image.shape
    x, y = found.origin
    return x - 0.5, x + nx - 0.5, y + ny - 0.5, y - 0.5
