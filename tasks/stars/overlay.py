"""The picture of a frame with its identified and unidentified star images."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tasks.stars.image import StarImage
from tasks.stars.sources import STAR

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Okabe and Ito's colours; shapes differ too.
USED: dict[str, Any] = {"marker": "o", "edgecolors": "#56B4E9", "label": "identified star"}
FAINT: dict[str, Any] = {
    "marker": "o",
    "edgecolors": "#56B4E9",
    "linestyle": ":",
    "label": "identified, too faint to count",
}
UNKNOWN: dict[str, Any] = {"marker": "s", "edgecolors": "#E69F00", "label": "not identified"}
UNLIKE: dict[str, Any] = {"marker": ".", "c": "#888888", "label": "peak unlike a star"}
UNSEEN: dict[str, Any] = {"marker": "+", "c": "#009E73", "label": "catalog star not seen"}
SIZE = 110.0
DPI, PNG_LEVEL = 110, 6
RESIDUAL_SCALE = 60.0  # times enlarged
SIDE_INCHES = 9.0
NAMED = 12


def draw_stars(found: StarImage, path: Path, title: str = "") -> Path:
    """Write the frame, in its own pixels, with its stars as PNG and return the path. Lines from identified stars are
    their residuals, enlarged."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    image = found.observation.image
    ny, nx = image.shape
    figure = Figure(figsize=(SIDE_INCHES, SIDE_INCHES * ny / nx + 1.0), dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    axes.imshow(_stretched(image, found.observation.usable), cmap="gray", vmin=0, vmax=1, origin="upper")
    axes.set(xlim=(-0.5, nx - 0.5), ylim=(ny - 0.5, -0.5), xlabel="x (px)", ylabel="y (px)", title=title)
    _draw(axes, found)
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(
        handles, labels, loc="outside lower center", ncols=4, fontsize=9, facecolor="#333333", labelcolor="white"
    )
    figure.savefig(path, format="png", pil_kwargs={"compress_level": PNG_LEVEL})
    return path


def _draw(axes: "Axes", found: StarImage) -> None:
    field, lock = found.field, found.field.lock
    places, strong = field.sources.xy_px, np.arange(field.strong)
    used = np.zeros(0, int) if lock is None else lock.matched.detection
    others, like = np.setdiff1d(strong, used), field.sources.kind == STAR
    _marks(axes, places[others[like[others]]], UNKNOWN)
    _marks(axes, places[others[~like[others]]], UNLIKE, filled=True)
    if lock is None or field.faint is None:
        return
    faint = field.faint[0]
    turned = lock.matched.orientation.camera_from_j2000
    computed = field.model.distort_points(found.camera.project(lock.directions @ turned.T))
    seen = np.concatenate([lock.matched.star, field.faint[1]])
    dim = np.nanmax(lock.table.magnitude[lock.matched.star])
    others = np.setdiff1d(np.flatnonzero(lock.table.magnitude <= dim), seen)
    ny, nx = found.observation.image.shape
    others = others[((computed[others] > -0.5) & (computed[others] < [nx - 0.5, ny - 0.5])).all(axis=1)]
    x, y = np.rint(computed[others]).astype(int).clip(0, [nx - 1, ny - 1]).T
    _marks(axes, computed[others][found.observation.usable[y, x]], UNSEEN, filled=True)
    _marks(axes, places[faint], FAINT)
    _marks(axes, places[used], USED)
    for at, star in zip(places[used], lock.matched.star, strict=True):
        end = at + RESIDUAL_SCALE * (at - computed[star])
        axes.plot(*np.stack([at, end]).T, color="#56B4E9", linewidth=0.9)
    for number in range(min(NAMED, len(used))):
        star = lock.matched.star[number]
        text = f"{lock.table.magnitude[star]:.1f}"
        axes.annotate(
            text, places[used[number]], xytext=(8, 6), textcoords="offset points", fontsize=7, color="#56B4E9"
        )


def _marks(axes: "Axes", places: NDArray[np.float64], style: dict[str, Any], filled: bool = False) -> None:
    if len(places):
        more: dict[str, Any] = {} if filled else {"facecolors": "none"}
        axes.scatter(places[:, 0], places[:, 1], s=SIZE / 3 if filled else SIZE, linewidths=1.1, **more, **style)


def _stretched(image: NDArray[np.float32], usable: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Grey values 0-1 that show faint stars on the sky: from 3 below to 12 robust sigmas above its median."""
    known = image[usable & np.isfinite(image)]
    if not known.size:
        return np.zeros_like(image)
    low, middle, high = np.percentile(known, [16.0, 50.0, 84.0])
    sigma = max(float(high - low) / 2, 1e-30)
    return np.asarray(np.clip((np.nan_to_num(image, nan=low) - middle + 3 * sigma) / (15 * sigma), 0, 1), np.float32)
